//! The load, from twist and gap (model.md section 4): rods and strings are the rig's own load cell.
//!
//! They measure their pull S, which at rest is anywhere within the rail's friction f of the load W: W − f ≤ S ≤ W + f.
//! While the load moves, the pull is at one end of that band: S = W + f on the way up, W − f on the way down. So
//! - a pull outside the band means another load, and the estimate follows at once;
//! - a pull inside it says something of the load only as far as the load has travelled, and at rest nothing.
//!
//! The estimate is a Newton step of the table's inverse each tick, damped. One lookup at the expected pull serves the
//! estimate and TR alike.

use crate::TICK_S;
use crate::mechanism::Mechanism;
use rig_link::messages::LoadChoice;
use tsa_table::Point;

/// How long the estimate takes to follow (s): longer than a swing of the load, shorter than a step of it matters.
const TIME_CONSTANT_S: f32 = 0.15;
/// Travel (m) after which it follows when the load moves slowly.
const TRAVEL_M: f32 = 0.3e-3;
/// Largest relative change of the estimate in one tick: keeps Newton from overshooting where the gap bends like 1/F.
const LARGEST_STEP: f32 = 0.2;
/// Change of the gap (m) that is motion and not noise: four times that of an LVDT block.
const MOTION_M: f32 = 15e-6;
/// Pull beyond the friction band that is no noise: a gap (m) and a share of the load.
const OUTSIDE_M: f32 = 15e-6;
const OUTSIDE_SHARE: f32 = 0.01;
/// Smoothing of the pull (s).
const PULL_S: f32 = 0.05;
/// Load speed (m/s) above which inertia, damping and the readings' age count for more than the estimate's floor.
const FAST_M_PER_S: f32 = 20e-3;
/// Time without a pull outside the friction band (ticks) after which the estimate has settled.
const SETTLED_TICKS: u16 = 40;
/// Share of the confirmed load that the estimate may leave it by: drift, warm-up and friction do no more.
const CONFIRMED_SHARE: f32 = 0.1;
/// Greatest difference (share of the load) of a move up and a move down that confirm the load.
const SAME_SHARE: f32 = 0.05;

/// How far the estimate can be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Confidence {
    /// Within its floors.
    Sure,
    /// So light that friction is a large part of it.
    Light,
    /// Moving too fast for a static balance.
    Fast,
    /// The pull has just been outside the friction band: another load, or not settled yet.
    Changing,
    /// It has changed since it was last confirmed, by another load, by a string that slipped, or by a sensor that shifted:
    /// gap and twist alone cannot show which.
    Unconfirmed,
}

/// The load observer.
#[derive(Clone, Copy, Debug)]
pub struct LoadObserver {
    load_n: f32,
    /// Measured less modelled gap, found at homing (m).
    offset_m: f32,
    /// Coulomb friction of the rail, found at homing (N).
    friction_n: f32,
    /// +1 after the load has moved up, −1 down.
    direction: f32,
    /// The gap, which follows measured ones only as far as they differ by more than noise (m).
    noise_free_gap_m: Option<f32>,
    /// Smoothed innovation: measured less expected pull (N).
    innovation_n: f32,
    /// Smoothed speed of the gap (m/s).
    gap_speed_m_per_s: f32,
    quiet_ticks: u16,
    /// The load as it was last confirmed (N), if it was.
    confirmed_n: Option<f32>,
    /// Moves cannot confirm the load: the sensor or the strings are far from what the table was made for.
    distrusted: bool,
    /// Load at the end of the last move down and of the last move up (N), where it was the same all along the move.
    way_load_n: [Option<f32>; 2],
    /// Where the load for TR comes from.
    pub source: LoadChoice,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Load (N): given, or estimated.
    pub load_n: f32,
    /// Friction between load and pull (N).
    pub friction_n: f32,
    /// What the strings pull with now (N), smoothed.
    pub pull_n: f32,
    /// The table's gap for that pull (m): measured, less the offset, smoothed.
    pub modelled_gap_m: f32,
    /// The table at this twist and the pull that is expected in the present direction.
    pub point: Point,
    /// How far the load moved beyond noise in this tick (m).
    pub moved_m: f32,
    /// The estimate stands at the end of the table's range.
    pub at_range_end: bool,
    /// How far the estimate can be relied on.
    pub confidence: Confidence,
}

impl LoadObserver {
    /// Starts from a weighed load (N), the gap offset (m) that goes with it and the rail's friction (N), after a way down.
    pub const fn new(load_n: f32, offset_m: f32, friction_n: f32) -> Self {
        Self {
            load_n,
            offset_m,
            friction_n,
            direction: -1.0,
            noise_free_gap_m: None,
            innovation_n: 0.0,
            gap_speed_m_per_s: 0.0,
            quiet_ticks: SETTLED_TICKS,
            confirmed_n: Some(load_n),
            distrusted: false,
            way_load_n: [None; 2],
            source: LoadChoice::Auto,
        }
    }

    /// The estimate (N).
    pub fn load_n(&self) -> f32 {
        self.load_n
    }

    /// Adds `change_n` (N), by which another scale of the twist changes the estimate.
    pub fn rescale(&mut self, change_n: f32) {
        self.load_n += change_n;
    }

    /// Ends a move along which the load weighed the same (`agrees`) or did not. A move up and a move down with the same
    /// load confirm it: friction that has changed makes them differ, and a shifted gap looks like another load at each twist.
    pub fn end_move(&mut self, agrees: bool) {
        let way = usize::from(self.direction > 0.0);
        self.way_load_n[way] = agrees.then_some(self.load_n);
        if let [Some(down_n), Some(up_n)] = self.way_load_n
            && (up_n - down_n).abs() < SAME_SHARE * self.load_n
            && !self.distrusted
        {
            self.confirmed_n = Some(self.load_n);
        }
    }

    /// Never confirms the load: with such results of a homing twist and gap weigh wrongly by more than a tenth of the load,
    /// and moves would agree with each other all the same.
    pub fn distrust(&mut self) {
        (self.distrusted, self.confirmed_n) = (true, None);
    }

    /// The strings are outside the table's twists: the load is not confirmed any more.
    pub fn lose(&mut self) {
        self.quiet_ticks = 0;
        self.noise_free_gap_m = None;
        self.way_load_n = [None; 2];
        self.confirmed_n = None;
    }

    /// One tick: measured gap (m) and the twist (rad) at the time of that measurement; without a gap the estimate stays.
    pub fn step(&mut self, mechanism: &Mechanism<'_>, twist_rad: f32, gap_m: Option<f32>) -> Observation {
        let m = &mechanism.table.metadata;
        // First, because it decides at which end of the friction band the pull is expected.
        let moved_m = gap_m.map_or(0.0, |gap_m| self.track_gap(gap_m));
        let expected_n = self.load_n + self.direction * self.friction_n;
        let point = mechanism.at(expected_n, twist_rad);
        let mut at_range_end = false;
        if let Some(gap_m) = gap_m {
            let innovation_n = (gap_m - self.offset_m - point.gap_m) / point.dgap_dload_m_per_n;
            if innovation_n.is_finite() {
                self.innovation_n += TICK_S / PULL_S * (innovation_n - self.innovation_n);
                let load_n = self.load_n + self.correction(innovation_n, moved_m, &point);
                self.load_n = load_n.clamp(m.load_min_n, m.load_max_n);
                at_range_end = load_n != self.load_n;
            }
        }
        let confidence = if self.quiet_ticks < SETTLED_TICKS {
            Confidence::Changing
        } else if self.gap_speed_m_per_s.abs() > FAST_M_PER_S {
            Confidence::Fast
        } else if self.load_n < 1.2 * m.load_min_n || self.friction_n > 0.25 * self.load_n {
            Confidence::Light
        } else if self.confirmed_n.is_none_or(|known_n| (self.load_n - known_n).abs() > CONFIRMED_SHARE * known_n) {
            Confidence::Unconfirmed
        } else {
            Confidence::Sure
        };
        let pull_n = expected_n + self.innovation_n;
        let modelled_gap_m = point.gap_m + self.innovation_n * point.dgap_dload_m_per_n;
        let (load_n, point) = match self.source {
            LoadChoice::Auto => (self.load_n, point),
            LoadChoice::Known(given_n) => {
                let load_n = given_n.clamp(m.load_min_n, m.load_max_n);
                (load_n, mechanism.at(load_n + self.direction * self.friction_n, twist_rad))
            }
        };
        Observation {
            load_n,
            friction_n: self.friction_n,
            pull_n,
            modelled_gap_m,
            point,
            moved_m,
            at_range_end,
            confidence,
        }
    }

    /// How far the load has moved beyond noise (m); sets direction.
    fn track_gap(&mut self, gap_m: f32) -> f32 {
        let before = self.noise_free_gap_m.unwrap_or(gap_m);
        let after = before.clamp(gap_m - MOTION_M, gap_m + MOTION_M);
        self.noise_free_gap_m = Some(after);
        let moved_m = after - before;
        self.gap_speed_m_per_s += TICK_S / PULL_S * (moved_m / TICK_S - self.gap_speed_m_per_s);
        if moved_m != 0.0 {
            let direction = -libm::copysignf(1.0, moved_m);
            if direction != self.direction {
                // The same pull is now expected at the other end of the band.
                self.innovation_n -= 2.0 * direction * self.friction_n;
                self.direction = direction;
            }
        }
        moved_m.abs()
    }

    /// Change of the estimate (N) for a pull that differs from the expected one by `innovation_n`.
    fn correction(&mut self, innovation_n: f32, moved_m: f32, point: &Point) -> f32 {
        let outside_n = OUTSIDE_M / point.dgap_dload_m_per_n + OUTSIDE_SHARE * self.load_n;
        // Where the pull may be, relative to its end of the band.
        let (far, near) = (-2.0 * self.friction_n * self.direction, 0.0f32);
        let beyond = innovation_n - innovation_n.clamp(far.min(near), far.max(near));
        let follow = TICK_S / TIME_CONSTANT_S;
        let mut step = innovation_n * follow.min(moved_m / TRAVEL_M);
        if beyond.abs() > outside_n {
            step = if moved_m == 0.0 { beyond * follow } else { innovation_n * follow };
            self.quiet_ticks = 0;
            // Earlier moves belong to another load, or to another gap.
            self.way_load_n = [None; 2];
        } else {
            self.quiet_ticks = self.quiet_ticks.saturating_add(1);
        }
        step.clamp(-LARGEST_STEP * self.load_n, LARGEST_STEP * self.load_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A load that has changed to `load_n` since homing weighed it with 5 N.
    fn changed_to(load_n: f32) -> LoadObserver {
        LoadObserver { load_n, ..LoadObserver::new(5.0, 0.0, 0.05) }
    }

    /// A move that way (+1 up, -1 down) at whose end the load is estimated so.
    fn end_move(observer: &mut LoadObserver, direction: f32, load_n: f32, agrees: bool) {
        (observer.direction, observer.load_n) = (direction, load_n);
        observer.end_move(agrees);
    }

    #[test]
    fn a_way_up_and_a_way_down_that_agree_confirm_a_load() {
        let mut o = changed_to(7.0);
        end_move(&mut o, 1.0, 7.1, true);
        assert_eq!(o.confirmed_n, Some(5.0), "one way is not enough");
        end_move(&mut o, 1.0, 7.1, true);
        assert_eq!(o.confirmed_n, Some(5.0), "nor the same way twice");
        end_move(&mut o, -1.0, 6.9, true);
        assert_eq!(o.confirmed_n, Some(6.9));
    }

    #[test]
    fn ways_that_differ_or_disagree_with_the_table_confirm_nothing() {
        // Friction that has changed makes the ways differ.
        let mut o = changed_to(1.3);
        end_move(&mut o, 1.0, 1.3, true);
        end_move(&mut o, -1.0, 0.7, true);
        assert_eq!(o.confirmed_n, Some(5.0));
        // A shifted gap is another load at each twist; such a way takes back what the one before it found.
        let mut o = changed_to(7.0);
        end_move(&mut o, 1.0, 7.0, true);
        end_move(&mut o, -1.0, 7.0, false);
        assert_eq!(o.confirmed_n, Some(5.0));
    }

    #[test]
    fn a_distrusted_load_is_never_confirmed_and_a_lost_one_only_anew() {
        let mut o = changed_to(5.0);
        o.distrust();
        end_move(&mut o, 1.0, 5.0, true);
        end_move(&mut o, -1.0, 5.0, true);
        assert_eq!(o.confirmed_n, None);
        let mut o = changed_to(5.0);
        o.lose();
        assert_eq!(o.confirmed_n, None);
        end_move(&mut o, 1.0, 5.0, true);
        end_move(&mut o, -1.0, 5.0, true);
        assert_eq!(o.confirmed_n, Some(5.0));
    }
}
