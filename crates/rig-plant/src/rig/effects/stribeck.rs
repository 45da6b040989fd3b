//! Friction of the rail: it sticks with a little give (presliding), breaks loose at its static value, and falls with speed
//! to its Coulomb value (Stribeck).
//!
//! A spring in series with a slider whose limit is F(v) = Fc + (Fs − Fc) exp(−(v/vs)²). Whatever the spring holds more than
//! the limit is lost, so that the element only stores and loses energy.

/// Sizes of the rail's friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RailFriction {
    /// Coulomb friction Fc, N.
    pub coulomb_n: f64,
    /// Static friction over Coulomb friction, at least 1.
    pub stiction_ratio: f64,
    /// Stribeck speed vs, m/s; 0 for none.
    pub stribeck_m_per_s: f64,
    /// Give before the rail breaks loose, m; 0 for none.
    pub presliding_m: f64,
}

impl RailFriction {
    /// The slider's limit at a speed (m/s), N.
    pub fn limit_n(&self, speed_m_per_s: f64) -> f64 {
        let falls = match self.stribeck_m_per_s {
            0.0 => f64::from(u8::from(speed_m_per_s == 0.0)),
            vs => (-(speed_m_per_s / vs).powi(2)).exp(),
        };
        self.coulomb_n * (1.0 + (self.stiction_ratio - 1.0) * falls)
    }

    /// Stiffness of the give, N/m; infinite without one.
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.coulomb_n * self.stiction_ratio / self.presliding_m
    }
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
        friction: &RailFriction,
    ) -> f64 {
        let limit_n = friction.limit_n(speed_m_per_s);
        if friction.presliding_m <= 0.0 || limit_n <= 0.0 {
            self.give_m = 0.0;
            let free_n = (push_n.abs() - limit_n).max(0.0).copysign(push_n);
            return free_n / resistance;
        }
        let stiffness = friction.stiffness_n_per_m();
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
        let most_m = limit_n / stiffness;
        self.give_m = self.give_m.clamp(-most_m, most_m);
        mean
    }

    /// Force of the spring now, N, against the direction of its give.
    pub fn force_n(&self, friction: &RailFriction) -> f64 {
        if friction.presliding_m > 0.0 { friction.stiffness_n_per_m() * self.give_m } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRICTION: RailFriction =
        RailFriction { coulomb_n: 0.2, stiction_ratio: 1.5, stribeck_m_per_s: 2e-3, presliding_m: 10e-6 };
    const H: f64 = 2.5e-4;

    #[test]
    fn the_limit_falls_from_static_to_coulomb() {
        let limits = [0.0, 2e-3, 20e-3].map(|v| FRICTION.limit_n(v));
        let expected = [0.3, 0.2 + 0.1 * (-1f64).exp(), 0.2];
        assert!(limits.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{limits:?}");
        let coulomb = RailFriction { stiction_ratio: 1.0, ..FRICTION };
        assert_eq!(coulomb.limit_n(0.0), coulomb.limit_n(1.0));
    }

    /// A mass of 0.5 kg on the rail under a constant push: where it is after a second.
    fn pushed(push_n: f64, friction: &RailFriction) -> f64 {
        let (mass, mut element, mut position, mut speed) = (0.5, Stribeck::default(), 0.0, 0.0);
        for _ in 0..4000 {
            let inertia = 2.0 * mass / H;
            // With enough damping to end the swing on the give.
            let mean = element.mean_speed(H, inertia * speed + push_n, inertia + 20.0, speed, friction);
            position += H * mean;
            speed = 2.0 * mean - speed;
        }
        position
    }

    #[test]
    fn below_its_static_value_it_gives_a_little_and_above_it_slips() {
        let held = pushed(0.15, &FRICTION);
        assert!((held - 5e-6).abs() < 0.2e-6, "{held}: half of the static value, half of the give");
        let slips = pushed(0.35, &FRICTION);
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
            let mean = element.mean_speed(H, push, inertia + 1.0 + 0.5 * H * 200.0, speed, &FRICTION);
            position += H * mean;
            speed = 2.0 * mean - speed;
            stood += u32::from(mean.abs() < 0.1e-3);
            fastest = fastest.max(mean);
        }
        assert!(stood > 10_000, "it stands for {stood} of 40000 steps");
        assert!(fastest > 3e-3, "{fastest} m/s in a jump");
        let smooth = RailFriction { stiction_ratio: 1.0, ..FRICTION };
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
            let mean = element.mean_speed(H, resistance * speed + push_n, resistance, speed, &FRICTION);
            let end = 2.0 * mean - speed;
            let after_j = 0.5 * mass * end * end;
            lost_j += push_n * mean * H - (after_j - before_j);
            speed = end;
            let stored_j = 0.5 * element.force_n(&FRICTION).powi(2) / FRICTION.stiffness_n_per_m();
            assert!(lost_j - stored_j > -1e-9, "{lost_j} J lost, {stored_j} J stored at {t} s");
        }
        assert!(lost_j > 1e-3, "{lost_j}");
    }

    #[test]
    fn without_give_it_is_coulomb_friction() {
        let friction = RailFriction { presliding_m: 0.0, stiction_ratio: 1.0, ..FRICTION };
        let mut element = Stribeck::default();
        assert_eq!(element.mean_speed(H, 0.19, 100.0, 0.0, &friction), 0.0);
        assert!((element.mean_speed(H, -0.7, 100.0, 0.0, &friction) + 0.005).abs() < 1e-12);
    }
}
