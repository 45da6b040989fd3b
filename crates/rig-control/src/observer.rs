//! The load, from twist and gap (docs/explanation/model.md section 4): rods and strings are the rig's own load cell.
//!
//! They measure their pull S, which at rest is anywhere within the rail's friction f of the load W: W − f ≤ S ≤ W + f.
//! While the load moves, the pull is at one end of that band: S = W + f on the way up, W − f on the way down. So
//! - a pull outside the band means another load, and the estimate follows at once;
//! - a pull inside it says something of the load only as far as the load has travelled, and at rest nothing.
//!
//! S is taken from the observed motion ([`crate::load_motion`]): it is the weight that the load seems to have, which does not
//! change when the load accelerates.
//!
//! The estimate carries its error: half the width of the interval that holds the load nine times in ten. It adds up what
//! homing left open of the string's radius and of the gap's zero, the noise that homing measured, the friction band, what
//! the rods and strings do when the load has changed since homing, and how long ago that was.

use crate::homing::NINETY_PERCENT;
use crate::hysteresis::{MEMORY_COMPLETE_N, MEMORY_ERROR, RodMemory};
use crate::load_motion::{LoadMotion, Measured};
use crate::mechanism::Mechanism;
use crate::{TICK_S, load_state};
use rig_link::messages::{HomingResult, LoadChoice};
use tsa_table::{Point, Uncertainty};

/// How long the estimate takes to follow (s): longer than an oscillation of the load, shorter than a step of it matters.
const TIME_CONSTANT_S: f32 = 0.15;
/// Travel (m) after which it follows when the load moves slowly. It is several times what rail friction can hold back, and what counts
/// as travel elsewhere, too.
pub const TRAVEL_M: f32 = 0.3e-3;
/// Pull beyond the friction band that is no noise, as a fraction of the load, besides the motion that is no noise.
const OUTSIDE_FRACTION: f32 = 0.01;
/// Longer than the load's slowest oscillation (ticks). After this time without a pull outside the friction band the estimate has settled;
/// with this time constant such a pull vanishes from the error of the estimate; and so long a load rests before homing relies on its gap.
pub const SETTLED_TICKS: u16 = 40;
/// Standard deviation of a load that is anywhere within the friction band, as a fraction of the friction: 1/√3, with every place as
/// likely as the others.
const RESTING_BAND: f32 = 0.577;
/// Maximum by which the friction of a rail grows with its load, as a fraction of the load.
const MAX_FRICTION_GROWTH: f32 = 0.05;
/// Standard error by creep and warming up, as a fraction of the load, at once and in the end; and the time that it takes (s).
const DRIFT: [f32; 2] = [0.003, 0.012];
const DRIFT_S: f32 = 600.0;
/// Fraction of the confirmed load that the estimate may leave it by: drift, warm-up and friction do no more. A move up and a move
/// down confirm a load if they differ by less than half of that.
const CONFIRMED_FRACTION: f32 = 0.1;

/// Errors of the load that change along a move as a drift of the strings does, without being one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KnownErrors {
    /// By what the rods remember, as a fraction of the load: all of it, because along a move nothing corrects it.
    pub memory: f32,
    /// By a load that differs from the homed one, as a fraction of the homed one.
    pub change: f32,
    /// By friction that is not the same all along the way, and by creep and warming up since homing, 90 % (N, rms).
    pub noise_n: f32,
}

/// The observer of the load. Inside it a load is an *apparent* one: that which the table's mechanism would show at this
/// twist and gap. What is reported is the load itself, which rods that remember a heavier one make seem heavier.
#[derive(Clone, Copy, Debug)]
pub struct LoadObserver {
    /// How the load moves; `None` before the first gap and outside the table's twists.
    pub motion: Option<LoadMotion>,
    /// The apparent load (N).
    pub apparent_n: f32,
    /// As homing left it: apparent load (N), covariance of scale, curve and slope, noise of the gap (m), relative error of a change.
    homed_n: f32,
    covariance: [f32; 6],
    gap_noise_m: f32,
    shape_error: f32,
    /// Standard error that no gap shows, as a fraction of the load: by how the radius depends on the load, which a weight that the
    /// operator gives includes. All of homing's error where homing could not weigh the load.
    hidden_error: f32,
    /// What the rods remember.
    pub memory: RodMemory,
    /// Maximum pull, less noise, since the load last stood (N).
    peak_n: f32,
    /// Time since homing (s).
    age_s: f32,
    /// Coulomb friction of the rail, found at homing (N).
    homed_friction_n: f32,
    /// Standard error of where the pull is within the friction band, as a fraction of the friction. It is 0 after the load has moved,
    /// because the pull is then at an end of the band.
    band: f32,
    /// +1 after the load has moved up, −1 down.
    direction: f32,
    /// The gap, which follows measured ones only as far as they differ by more than noise (m).
    noise_free_gap_m: Option<f32>,
    quiet_ticks: u16,
    /// Maximum pull outside the friction band in the last moments (N).
    unsettled_n: f32,
    /// The load as it was last confirmed (N), if it was.
    confirmed_n: Option<f32>,
    /// Load at the end of the last move down and of the last move up (N), where it was the same all along the move.
    moved_load_n: [Option<f32>; 2],
    /// Where the load for TR comes from.
    pub source: LoadChoice,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Load with which the table's mechanism is evaluated (N): given, or the apparent one.
    pub mechanism_load_n: f32,
    /// What the strings pull with (N).
    pub pull_n: f32,
    /// The apparent load that this tick alone shows if the load moves (N), without the lag of the estimate.
    pub shown_n: f32,
    /// The table at this twist and the pull that is expected in the present direction.
    pub point: Point,
    /// How far the load moved beyond noise in this tick (m).
    pub moved_m: f32,
    /// The estimate stands at the end of the table's range; at the light end only if the load is lighter than that by more
    /// than the error of the estimate.
    pub at_range_end: bool,
    /// Error of the estimate, 90 % (N).
    pub load_error_n: f32,
    /// Coulomb friction of the rail under this load (N).
    pub friction_n: f32,
    /// The pull has just been outside the friction band: another load, or not settled yet.
    pub changing: bool,
    /// The load is that of homing, or moves have confirmed it since.
    pub confirmed: bool,
}

/// Standard error (m) of the gap at a point of the table and a twist (rad), by what homing left open of scale, curve and slope
/// together ([`HomingResult::covariance`]). At the twists of the sweeps it is as large as the error of the homed load makes it, because
/// the fit found all of them from these gaps.
pub(crate) fn open_gap_m(covariance: &[f32; 6], point: &Point, twist_rad: f32) -> f32 {
    let by = [point.dgap_dtwist_m_per_rad * twist_rad, 1.0, point.gap_m];
    let rows = [[0, 1, 3], [1, 2, 4], [3, 4, 5]];
    let times = |row: [usize; 3]| row.iter().zip(by).map(|(k, by)| covariance[*k] * by).sum::<f32>();
    libm::sqrtf(rows.into_iter().zip(by).map(|(row, by)| by * times(row)).sum::<f32>().max(0.0))
}

impl LoadObserver {
    /// Starts from a homing, after a way down, with how well the table's mechanism is known, and with the heaviest load (N)
    /// that the rods remembered at that homing.
    pub fn new(homed: &HomingResult, known: &Uncertainty, heaviest_n: f32) -> Self {
        let memory = RodMemory { light: known.rod_memory, heaviest_n: heaviest_n.max(homed.load_n) };
        let homed_n = memory.apparent_n(homed.load_n);
        let homed_fraction = homed.load_error_n / (NINETY_PERCENT * homed.load_n);
        let is_weighed = homed.load_error_n < homed.load_n;
        Self {
            motion: None,
            apparent_n: homed_n,
            homed_n,
            covariance: homed.covariance,
            gap_noise_m: homed.gap_noise_m,
            shape_error: known.load_shape,
            hidden_error: if is_weighed { known.load_shape.min(homed_fraction) } else { homed_fraction },
            memory,
            peak_n: 0.0,
            age_s: 0.0,
            homed_friction_n: homed.friction_n,
            band: 0.0,
            direction: -1.0,
            noise_free_gap_m: None,
            quiet_ticks: SETTLED_TICKS,
            unsettled_n: 0.0,
            confirmed_n: Some(homed_n),
            moved_load_n: [None; 2],
            source: LoadChoice::Auto,
        }
    }

    /// The load that hangs (N).
    pub fn load_n(&self) -> f32 {
        self.memory.load_n(self.apparent_n)
    }

    /// Coulomb friction of the rail (N). Some of what homing found grows with the load, and one homing cannot tell how much: under a
    /// lighter load the friction is anywhere between the homed one and the least that it can have fallen to, and is taken in the
    /// middle. Under a heavier one it stays as homed: with friction that grows there, fewer stated errors of heavy loads hold the truth
    /// (constants.csv).
    fn friction_n(&self) -> f32 {
        let growth = MAX_FRICTION_GROWTH.min(self.homed_friction_n / self.homed_n);
        self.homed_friction_n - 0.5 * growth * (self.homed_n - self.apparent_n).max(0.0)
    }

    /// Ends a move along which the load weighed the same (`agrees`) or did not. A move up and a move down with the same
    /// load confirm it: friction that has changed makes them differ, and a shifted gap looks like another load at each twist.
    pub fn end_move(&mut self, agrees: bool) {
        let way = usize::from(self.direction > 0.0);
        self.moved_load_n[way] = agrees.then_some(self.apparent_n);
        if let [Some(down_n), Some(up_n)] = self.moved_load_n
            && (up_n - down_n).abs() < 0.5 * CONFIRMED_FRACTION * self.apparent_n
        {
            self.confirmed_n = Some(self.apparent_n);
        }
    }

    /// Whether the load is that of homing or has been confirmed since. Gap and twist alone cannot show whether another load,
    /// a string that slipped, or a sensor that shifted has changed it.
    fn is_confirmed(&self) -> bool {
        self.confirmed_n.is_some_and(|known_n| (self.apparent_n - known_n).abs() <= CONFIRMED_FRACTION * known_n)
    }

    /// The strings are outside the table's twists: nothing is known of the load any more.
    pub fn lose(&mut self) {
        self.quiet_ticks = 0;
        self.moved_load_n = [None; 2];
        self.confirmed_n = None;
        self.noise_free_gap_m = None;
        self.motion = None;
        self.band = RESTING_BAND;
    }

    /// With another scale of the twist the same gap shows a load that is greater by so much (N). It has not changed.
    pub fn shift_load(&mut self, change_n: f32) {
        self.apparent_n += change_n;
        if let Some(motion) = &mut self.motion {
            motion.weight_n += change_n;
            motion.pull_n += change_n;
        }
    }

    /// Errors of the load that a move may show as if the strings had drifted.
    pub fn known_errors(&self) -> KnownErrors {
        let change = self.shape_error * (self.apparent_n - self.homed_n).abs() / self.homed_n;
        let noise_n = libm::hypotf(NINETY_PERCENT * DRIFT[0] * self.apparent_n, RESTING_BAND * self.friction_n());
        KnownErrors { memory: self.memory.excess(self.load_n()), change, noise_n }
    }

    /// Error of a load that hangs still, 90 % (N), at a point of the table and a twist (rad).
    fn still_error_n(&self, point: &Point, twist_rad: f32) -> f32 {
        let open_m = open_gap_m(&self.covariance, point, twist_rad);
        let gap_n = libm::hypotf(open_m, self.gap_noise_m) / point.dgap_dload_m_per_n;
        let load_n = self.load_n();
        let hidden_n = self.hidden_error * load_n;
        let friction_n = self.friction_n();
        let band_n = self.band * friction_n;
        // Half the width of what the friction may be, with every place in it as likely as the others.
        let growth_n = RESTING_BAND * (self.homed_friction_n - friction_n);
        let change_n = self.shape_error * (self.apparent_n - self.homed_n);
        let memory_n = MEMORY_ERROR * self.memory.excess(load_n) * load_n;
        let drift = DRIFT[0] + (DRIFT[1] - DRIFT[0]) * (self.age_s / DRIFT_S).min(1.0);
        let drift_n = drift * load_n;
        let parts_n = [gap_n, hidden_n, band_n, growth_n, change_n, memory_n, drift_n];
        NINETY_PERCENT * libm::sqrtf(parts_n.iter().map(|part_n| part_n * part_n).sum())
    }

    /// One tick: a measured gap and the twist (rad) at the time of that measurement; without a gap the estimate stays.
    pub fn step(&mut self, mechanism: &Mechanism<'_>, twist_rad: f32, measured: Option<&Measured>) -> Observation {
        let m = &mechanism.table.metadata;
        self.age_s += TICK_S;
        // First, because it decides at which end of the friction band the pull is expected.
        let moved_m = measured.map_or(0.0, |measured| self.track_gap(measured.gap_m));
        let expected_n = self.apparent_n + self.direction * self.friction_n();
        let point = mechanism.at(expected_n, twist_rad);
        let mut at_range_end = false;
        let mut pull_n = expected_n;
        let mut shown_n = self.apparent_n;
        if let Some(measured) = measured {
            let motion = self
                .motion
                .get_or_insert_with(|| LoadMotion::at_rest(mechanism, measured.gap_m, twist_rad, expected_n));
            motion.step(mechanism, twist_rad, measured);
            pull_n = motion.pull_n;
            let innovation_n = motion.weight_n - expected_n;
            shown_n += innovation_n;
            let noise_n =
                load_state::moved_m(self.gap_noise_m) / point.dgap_dload_m_per_n + OUTSIDE_FRACTION * self.apparent_n;
            self.peak_n = self.peak_n.max((pull_n - noise_n).min(m.load_max_n));
            let load_n = self.apparent_n + self.correction(innovation_n, moved_m, noise_n);
            self.apparent_n = load_n.clamp(m.load_min_n, m.load_max_n);
            // A load that is too heavy is a danger. One that is too light is none, and may still be within the range, by
            // the error of the estimate.
            let light = load_n < m.load_min_n && -innovation_n > self.still_error_n(&point, twist_rad);
            at_range_end = load_n > m.load_max_n || light;
        }
        // A load that somebody lets go of falls past its place and swings. When the swing has died away, the rods are halfway between
        // their stress under a load that was hung on slowly and that after a heavier load. It counts once the load stands,
        // because a sensor that shifts shows the same at first.
        if self.quiet_ticks >= SETTLED_TICKS {
            let past_n = (self.peak_n - self.apparent_n).clamp(0.0, MEMORY_COMPLETE_N);
            self.memory.heaviest_n = self.memory.heaviest_n.max(self.apparent_n + 0.5 * past_n);
            self.peak_n = 0.0;
        }
        let load_error_n = self.still_error_n(&point, twist_rad) + self.unsettled_n;
        let (mechanism_load_n, point) = match self.source {
            LoadChoice::Auto => (self.apparent_n, point),
            LoadChoice::Known(given_n) => {
                let load_n = given_n.clamp(m.load_min_n, m.load_max_n);
                (load_n, mechanism.at(load_n + self.direction * self.friction_n(), twist_rad))
            }
        };
        Observation {
            mechanism_load_n,
            pull_n,
            shown_n,
            point,
            moved_m,
            at_range_end,
            load_error_n,
            friction_n: self.friction_n(),
            changing: self.quiet_ticks < SETTLED_TICKS,
            confirmed: self.is_confirmed(),
        }
    }

    /// How far the load has moved beyond noise (m); sets direction.
    fn track_gap(&mut self, gap_m: f32) -> f32 {
        let motion_m = load_state::moved_m(self.gap_noise_m);
        let before = self.noise_free_gap_m.unwrap_or(gap_m);
        let after = before.clamp(gap_m - motion_m, gap_m + motion_m);
        self.noise_free_gap_m = Some(after);
        let moved_m = after - before;
        if moved_m != 0.0 {
            // From now on the pull is expected at the other end of the band.
            self.direction = -libm::copysignf(1.0, moved_m);
        }
        moved_m.abs()
    }

    /// Change of the estimate (N) for a pull that differs from the expected one by `innovation_n`. Outside the friction band
    /// `noise_n` is no other load.
    fn correction(&mut self, innovation_n: f32, moved_m: f32, noise_n: f32) -> f32 {
        // Where the pull may be, relative to its end of the band.
        let (far, near) = (-2.0 * self.friction_n() * self.direction, 0.0f32);
        let beyond = innovation_n - innovation_n.clamp(far.min(near), far.max(near));
        let follow = TICK_S / TIME_CONSTANT_S;
        let mut step = innovation_n * follow.min(moved_m / TRAVEL_M);
        self.band *= 1.0 - (moved_m / TRAVEL_M).min(1.0);
        self.unsettled_n *= 1.0 - 1.0 / f32::from(SETTLED_TICKS);
        if beyond.abs() > noise_n {
            step = if moved_m == 0.0 { beyond * follow } else { innovation_n * follow };
            self.quiet_ticks = 0;
            // Earlier moves belong to another load, or to another gap.
            self.moved_load_n = [None; 2];
            self.band = RESTING_BAND;
            self.unsettled_n = self.unsettled_n.max(beyond.abs());
        } else {
            self.quiet_ticks = self.quiet_ticks.saturating_add(1);
        }
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::homing::load_estimate::MIN_GAP_ERROR_M;
    use crate::hysteresis::memory_shape;
    use rig_link::messages::GapCurve;

    /// A load of 5 N, with half a newton of error, without friction or noise; the scale is known to 1 %.
    const HOMED: HomingResult = HomingResult {
        zero_error_rad: 0.0,
        load_n: 5.0,
        load_error_n: 0.5,
        friction_n: 0.0,
        reference_gap_m: 0.06,
        gap_noise_m: MIN_GAP_ERROR_M,
        jump_m: 0.0,
        twist_scale: 1.0,
        curve: GapCurve::constant(0.0),
        covariance: [1e-4, 0.0, 0.0, 0.0, 0.0, 0.0],
        drive_lag_s: 0.03,
    };

    fn observer(shape_error: f32) -> LoadObserver {
        after(0.0, shape_error)
    }

    /// The same on rods that remember a load (N), of which a light one seems a fifth heavier.
    fn after(heaviest_n: f32, shape_error: f32) -> LoadObserver {
        let known = Uncertainty { twist_scale: 0.01, gap_zero_m: 1e-4, load_shape: shape_error, rod_memory: 0.2 };
        LoadObserver::new(&HOMED, &known, heaviest_n)
    }

    /// 1 mm/rad and 1 mm/N: a scale that is wrong by 1 % at 20 rad is 0.2 mm, or 0.2 N.
    const POINT: Point = Point { gap_m: 0.05, dgap_dtwist_m_per_rad: -1e-3, dgap_dload_m_per_n: 1e-3 };
    const DRIFT_N: f32 = DRIFT[0] * 5.0;
    const NOISE_N: f32 = 1e3 * MIN_GAP_ERROR_M;

    /// The root of the sum of the squares.
    fn together(parts: &[f32]) -> f32 {
        libm::sqrtf(parts.iter().map(|x| x * x).sum())
    }

    fn same(found_n: f32, expected_n: f32) -> bool {
        (found_n / expected_n - 1.0).abs() < 1e-4
    }

    #[test]
    fn far_twists_leave_more_of_the_load_open() {
        for (twist_rad, open_n) in [(20.0, 0.2), (60.0, 0.6)] {
            let found_n = observer(0.0).still_error_n(&POINT, twist_rad);
            assert!(same(found_n, NINETY_PERCENT * together(&[open_n, NOISE_N, DRIFT_N])), "{found_n}");
        }
    }

    #[test]
    fn no_gap_shows_how_the_radius_depends_on_the_load_unless_the_operator_gave_a_weight() {
        let known = Uncertainty { twist_scale: 0.01, gap_zero_m: 1e-4, load_shape: 0.03, rod_memory: 0.0 };
        // By homing's own error (N): a load that was weighed, a weight that was given, and a load that is not known.
        for (homed_error_n, hidden_n) in [(0.5, 0.03 * 5.0), (0.04, 0.04 / NINETY_PERCENT), (8.0, 8.0 / NINETY_PERCENT)]
        {
            let homed = HomingResult { load_error_n: homed_error_n, ..HOMED };
            let found_n = LoadObserver::new(&homed, &known, 0.0).still_error_n(&POINT, 0.0);
            assert!(
                same(found_n, NINETY_PERCENT * together(&[hidden_n, NOISE_N, DRIFT_N])),
                "{homed_error_n}: {found_n}"
            );
        }
    }

    #[test]
    fn errors_of_scale_and_curve_that_go_together_make_up_for_each_other() {
        let mut o = observer(0.0);
        // At 60 rad the scale moves the gap by −60 mm: 3.6e-7 − 2 · 0.06 · 2e-6 + 1e-7 m². The slope moves it by 50 mm:
        // 2.5e-7 − 2 · 0.06 · 0.05 · 3e-5 + 2 · 0.05 · 2e-6 m².
        for (slope, open_m2) in [([0.0; 3], 2.2e-7), ([3e-5, 2e-6, 1e-4], 4.9e-7)] {
            o.covariance = [1e-4, 2e-6, 1e-7, slope[0], slope[1], slope[2]];
            let found_n = o.still_error_n(&POINT, 60.0);
            let expected_n = NINETY_PERCENT * together(&[libm::sqrtf(open_m2) / 1e-3, DRIFT_N]);
            assert!(same(found_n, expected_n), "{found_n} instead of {expected_n}");
        }
    }

    #[test]
    fn a_confirmed_load_may_drift_by_a_tenth_and_two_ways_must_agree() {
        let mut o = observer(0.0);
        for (change_n, confirmed) in [(0.45, true), (0.1, false), (-1.0, true), (-0.1, false)] {
            o.apparent_n += change_n;
            assert_eq!(o.is_confirmed(), confirmed, "{}", o.apparent_n);
        }
        // Up and down differ by 6 %, and then by 4 %.
        for (up_n, confirmed) in [(1.06 * o.apparent_n, false), (1.04 * o.apparent_n, true)] {
            let down_n = o.apparent_n;
            (o.direction, o.moved_load_n) = (-1.0, [None; 2]);
            o.end_move(true);
            (o.direction, o.apparent_n) = (1.0, up_n);
            o.end_move(true);
            assert_eq!(o.confirmed_n == Some(up_n), confirmed);
            o.apparent_n = down_n;
        }
    }

    /// Homed under 5 N after 6 N: the mechanism shows more than hangs.
    #[test]
    fn a_load_on_rods_that_remember_a_heavier_one_seems_heavier_than_what_is_reported() {
        let o = after(6.0, 0.0);
        let excess = 0.2 * memory_shape(5.0, 6.0);
        assert!(same(o.apparent_n, 5.0 * (1.0 + excess)) && same(o.load_n(), 5.0), "{o:?}");
        let error_n = o.still_error_n(&POINT, 0.0);
        let parts = [MEMORY_ERROR * excess * 5.0, NOISE_N, DRIFT_N];
        assert!(same(error_n, NINETY_PERCENT * together(&parts)), "{error_n}");
    }

    #[test]
    fn along_a_move_friction_and_creep_are_no_evidence() {
        let mut o = observer(0.0);
        o.homed_friction_n = 0.4;
        let expected_n = together(&[NINETY_PERCENT * 0.003 * 5.0, RESTING_BAND * 0.4]);
        assert!(same(o.known_errors().noise_n, expected_n), "{:?}", o.known_errors());
    }

    #[test]
    fn friction_falls_with_the_load_by_half_of_what_it_may_and_does_not_grow() {
        let mut o = observer(0.0);
        // Of 5 N, a rail with 0.4 N may have 0.05 that grow with it; one with 0.1 N has 0.02 of it at most.
        for (homed_friction_n, apparent_n, friction_n) in
            [(0.4, 5.0, 0.4), (0.4, 1.0, 0.3), (0.4, 9.0, 0.4), (0.1, 1.0, 0.06), (0.0, 1.0, 0.0)]
        {
            (o.homed_friction_n, o.apparent_n) = (homed_friction_n, apparent_n);
            assert!((o.friction_n() - friction_n).abs() < 1e-6, "{} for {friction_n}", o.friction_n());
        }
    }

    #[test]
    fn each_part_of_the_error_adds_its_square() {
        let mut o = observer(0.1);
        o.homed_friction_n = 0.4;
        o.band = 0.3;
        o.memory.heaviest_n = 10.0;
        o.apparent_n = o.memory.apparent_n(3.0);
        let load_n = o.load_n();
        let memory = MEMORY_ERROR * o.memory.excess(load_n);
        // The friction may have fallen by up to a twentieth of the difference between the loads.
        let fallen_n = 0.5 * 0.05 * (5.0 - o.apparent_n);
        let parts = [
            0.5 / (5.0 * NINETY_PERCENT) * load_n,
            0.3 * (0.4 - fallen_n),
            fallen_n / libm::sqrtf(3.0),
            0.1 * (5.0 - o.apparent_n),
            memory * load_n,
            DRIFT[0] * load_n,
            NOISE_N,
        ];
        let expected_n = NINETY_PERCENT * together(&parts);
        let found_n = o.still_error_n(&POINT, 0.0);
        assert!(same(found_n, expected_n), "{found_n} {expected_n}");
    }
}
