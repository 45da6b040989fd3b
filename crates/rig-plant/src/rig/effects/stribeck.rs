//! Friction of the rail: it sticks with a little give (presliding), breaks loose at its static value, and falls with speed
//! to its Coulomb value (Stribeck).
//!
//! A spring in series with a slider whose limit is F(v) = Fc + (Fs − Fc) exp(−(v/vs)²). Whatever the spring holds more than
//! the limit is lost, so that the element only stores and loses energy.

use crate::PlantSettings;

/// Coulomb friction Fc of the rail, N.
pub fn coulomb_n(settings: &PlantSettings) -> f64 {
    settings.friction_n + settings.friction_load_share * settings.load_n
}

/// The slider's limit at a speed (m/s), N.
fn limit_n(settings: &PlantSettings, speed_m_per_s: f64) -> f64 {
    let falls = match settings.stribeck_speed_m_per_s {
        0.0 => f64::from(u8::from(speed_m_per_s == 0.0)),
        vs => (-(speed_m_per_s / vs).powi(2)).exp(),
    };
    coulomb_n(settings) * (1.0 + (settings.stiction_ratio - 1.0) * falls)
}

/// Stiffness of the give, N/m; infinite without one.
fn stiffness_n_per_m(settings: &PlantSettings) -> f64 {
    coulomb_n(settings) * settings.stiction_ratio / settings.presliding_m
}

/// State of the spring in front of the slider, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stribeck {
    give_m: f64,
}

impl Stribeck {
    /// The mean speed (m/s) over a step of `h` seconds of a load that would be pushed by `push_n` against `resistance`
    /// (N s/m, everything that grows with the mean speed), and that had a speed before the step.
    pub fn mean_speed(
        &mut self,
        h: f64,
        push_n: f64,
        resistance: f64,
        speed_m_per_s: f64,
        settings: &PlantSettings,
    ) -> f64 {
        let limit_n = limit_n(settings, speed_m_per_s);
        if settings.presliding_m <= 0.0 || limit_n <= 0.0 {
            self.give_m = 0.0;
            let free_n = (push_n.abs() - limit_n).max(0.0).copysign(push_n);
            return free_n / resistance;
        }
        let stiffness = stiffness_n_per_m(settings);
        // Sticking: the spring's force at the middle of the step.
        let sticking = (push_n - stiffness * self.give_m) / (resistance + 0.5 * h * stiffness);
        let force_n = stiffness * (self.give_m + 0.5 * h * sticking);
        let mean = if force_n.abs() <= limit_n {
            self.give_m += h * sticking;
            sticking
        } else {
            let slipping = (push_n - limit_n.copysign(force_n)) / resistance;
            self.give_m = limit_n.copysign(force_n) / stiffness;
            slipping
        };
        let max_m = limit_n / stiffness;
        self.give_m = self.give_m.clamp(-max_m, max_m);
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn friction() -> PlantSettings {
        PlantSettings {
            friction_n: 0.2,
            stiction_ratio: 1.5,
            stribeck_speed_m_per_s: 2e-3,
            presliding_m: 10e-6,
            ..PlantSettings::default()
        }
    }

    const H: f64 = 2.5e-4;

    #[test]
    fn the_limit_falls_from_static_to_coulomb() {
        let limits = [0.0, 2e-3, 20e-3].map(|v| limit_n(&friction(), v));
        let expected = [0.3, 0.2 + 0.1 * (-1f64).exp(), 0.2];
        assert!(limits.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{limits:?}");
        let coulomb = PlantSettings { stiction_ratio: 1.0, ..friction() };
        assert_eq!(limit_n(&coulomb, 0.0), limit_n(&coulomb, 1.0));
    }

    /// A mass of 0.5 kg on the rail under a constant push: where it is after a second.
    fn pushed(push_n: f64, friction: &PlantSettings) -> f64 {
        let (mass, mut element, mut position, mut speed) = (0.5, Stribeck::default(), 0.0, 0.0);
        for _ in 0..4000 {
            let inertia = 2.0 * mass / H;
            // With enough damping to end the oscillation on the give.
            let mean = element.mean_speed(H, inertia * speed + push_n, inertia + 20.0, speed, friction);
            position += H * mean;
            speed = 2.0 * mean - speed;
        }
        position
    }

    #[test]
    fn below_its_static_value_it_gives_a_little_and_above_it_slips() {
        let held = pushed(0.15, &friction());
        assert!((held - 5e-6).abs() < 0.2e-6, "{held}: half of the static value, half of the give");
        let slips = pushed(0.35, &friction());
        assert!(slips > 1e-3, "{slips}");
    }

    #[test]
    fn pulled_by_a_slow_spring_it_sticks_and_slips() {
        // The strings of a light load: 200 N/m pulled at 1 mm/s.
        let (mass, mut element, mut position, mut speed) = (0.1, Stribeck::default(), 0.0, 0.0);
        let (mut stood, mut fastest) = (0, 0f64);
        for k in 0..40_000 {
            let pulled_m = 1e-3 * H * f64::from(k);
            let inertia = 2.0 * mass / H;
            let push = inertia * speed + 200.0 * (pulled_m - position);
            let mean = element.mean_speed(H, push, inertia + 1.0 + 0.5 * H * 200.0, speed, &friction());
            position += H * mean;
            speed = 2.0 * mean - speed;
            stood += u32::from(mean.abs() < 0.1e-3);
            fastest = fastest.max(mean);
        }
        assert!(stood > 10_000, "it stands for {stood} of 40000 steps");
        assert!(fastest > 3e-3, "{fastest} m/s in a jump");
        let smooth = PlantSettings { stiction_ratio: 1.0, ..friction() };
        let behind = pushed(0.15, &smooth);
        assert!(behind > 0.0);
    }

    #[test]
    fn it_takes_energy_and_gives_none() {
        let mut element = Stribeck::default();
        let (mut lost_j, mut speed) = (0.0, 0.0);
        let (mass, resistance) = (0.5, 2.0 * 0.5 / H);
        for k in 0..20_000 {
            let t = f64::from(k) * H;
            let push_n = 0.6 * (20.0 * t).sin() + 0.2 * (3.0 * t).cos();
            let before_j = 0.5 * mass * speed * speed;
            let mean = element.mean_speed(H, resistance * speed + push_n, resistance, speed, &friction());
            let end = 2.0 * mean - speed;
            let after_j = 0.5 * mass * end * end;
            lost_j += push_n * mean * H - (after_j - before_j);
            speed = end;
            let stored_j = 0.5 * stiffness_n_per_m(&friction()) * element.give_m.powi(2);
            assert!(lost_j - stored_j > -1e-9, "{lost_j} J lost, {stored_j} J stored at {t} s");
        }
        assert!(lost_j > 1e-3, "{lost_j}");
    }

    #[test]
    fn without_give_it_is_coulomb_friction() {
        let friction = PlantSettings { presliding_m: 0.0, stiction_ratio: 1.0, ..friction() };
        let mut element = Stribeck::default();
        assert_eq!(element.mean_speed(H, 0.19, 100.0, 0.0, &friction), 0.0);
        assert!((element.mean_speed(H, -0.7, 100.0, 0.0, &friction) + 0.005).abs() < 1e-12);
    }
}
