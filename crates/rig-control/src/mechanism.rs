//! The mechanism as this rig's strings really are: the table, corrected by a scale of the twist.
//!
//! Twist acts through the arc θ r of the strings (model.md 2), so a string a little thicker or thinner than the scene
//! says is one that is twisted a little more or less: G(F, s θ). One number then stands for everything that makes the
//! radius wrong: spread of the braid, creep, temperature.

use rig_link::messages::Setting;
use tsa_table::{Point, Table};

/// Bounds of the scale: a string farther off is not the one that the table was made for.
pub const TWIST_SCALE: [f32; 2] = Setting::TwistScale.spec().range;

/// How far beyond the table's twists a tangent continues it (rad): what the scale can shift the pre-twist by.
const TANGENT_RAD: f32 = 0.5;

/// The table and the rig's own scale.
#[derive(Clone, Copy, Debug)]
pub struct Mechanism<'t> {
    /// The table, with its metadata.
    pub table: &'t Table<'t>,
    /// Twist that the table is asked at, for each twist of this rig's strings.
    pub twist_scale: f32,
}

impl<'t> Mechanism<'t> {
    /// As the table says.
    pub fn nominal(table: &'t Table<'t>) -> Self {
        Self { table, twist_scale: 1.0 }
    }

    /// Gap and gradient at a load (N) and a twist (rad), each moved to the table's edge where it is outside; the gap a
    /// little beyond an end of the twist follows the tangent. One table lookup.
    pub fn at(&self, load_n: f32, twist_rad: f32) -> Point {
        let m = &self.table.metadata;
        let asked = self.twist_scale * twist_rad;
        let inside = asked.clamp(m.twist_min_rad, m.twist_max_rad);
        let mut point = self.table.point_inside(load_n, inside);
        point.gap_m += point.dgap_dtwist_m_per_rad * (asked - inside).clamp(-TANGENT_RAD, TANGENT_RAD);
        point.dgap_dtwist_m_per_rad *= self.twist_scale;
        point
    }

    /// Greatest twist (rad) that both the strings and the table stand.
    pub fn twist_max_rad(&self) -> f32 {
        let m = &self.table.metadata;
        m.twist_max_rad / self.twist_scale.max(1.0)
    }
}
