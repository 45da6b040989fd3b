//! Strings that go on stretching: Kelvin elements in series with their elastic stretch.
//!
//! A string under the load F is longer by F/2K at once. Each element adds its share of that with its own time:
//! τ dx/dt = c F − x. A spring and a dashpot beside each other store or lose what the load does to them and create nothing.

use crate::effects::CREEP_TIMES_S as TIMES_S;

/// Stretch of the strings beyond the elastic one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Creep {
    /// Compliance of each element, m/N.
    compliance: f64,
    stretch_m: [f64; TIMES_S.len()],
}

impl Creep {
    /// Elements that in the end add `share` of the elastic compliance 1/2K (m/N), and have added nothing yet.
    pub fn new(share: f64, elastic_m_per_n: f64) -> Self {
        Self { compliance: share * elastic_m_per_n / TIMES_S.len() as f64, stretch_m: [0.0; TIMES_S.len()] }
    }

    /// One step of `h` seconds under a load (N); exact for a load that stays. Returns the stretch, m.
    pub fn step(&mut self, h: f64, load_n: f64) -> f64 {
        for (stretch, time_s) in self.stretch_m.iter_mut().zip(TIMES_S) {
            *stretch += (self.compliance * load_n - *stretch) * -(-h / time_s).exp_m1();
        }
        self.stretch_m()
    }

    /// The stretch now, m.
    pub fn stretch_m(&self) -> f64 {
        self.stretch_m.iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_takes_its_times_and_reaches_its_share() {
        let (load_n, elastic) = (5.0, 1.0 / (2.0 * 1370.0));
        let mut creep = Creep::new(0.3, elastic);
        let mut at = |seconds: u32| {
            (0..seconds * 100).for_each(|_| {
                creep.step(0.01, load_n);
            });
            creep.stretch_m() / (0.1 * elastic * load_n)
        };
        let expected = |t: f64| TIMES_S.iter().map(|time| 1.0 - (-t / time).exp()).sum::<f64>();
        assert!((at(3) - expected(3.0)).abs() < 1e-9);
        assert!((at(57) - expected(60.0)).abs() < 1e-9);
        assert!((at(20_000) - 3.0).abs() < 1e-4, "a third each");
    }

    #[test]
    fn a_released_string_gives_back_less_than_was_put_in() {
        let mut creep = Creep::new(0.3, 4e-4);
        let (mut energy_j, mut last_m) = (0.0, 0.0);
        for k in 0..400_000u32 {
            let load_n = if k < 20_000 { 10.0 } else { 2.0 };
            let now_m = creep.step(0.01, load_n);
            energy_j += load_n * (now_m - last_m);
            last_m = now_m;
        }
        // What stays stored under 2 N is c F²/2 for each element.
        let stored = 0.5 * 0.3 * 4e-4 * 4.0;
        assert!(energy_j > stored, "{energy_j} J put in, {stored} J stored");
    }
}
