//! Hysteresis of the rods: after a heavier load, a load seems heavier than it is. Creep of the strings acts the same way, and
//! the same correction covers both.

/// Rods that have carried a heavier load remember it: on the way down their stress is lower, which looks like 0.4, 1.3 and
/// 1.0 N at 1, 5 and 10 N (crates/rig-plant/README.md). The load (N) over which the fraction of a light load falls.
const MEMORY_FALLS_N: f32 = 7.0;
/// How far below the heaviest load (N) what the rods remember is complete.
pub const MEMORY_COMPLETE_N: f32 = 4.0;
/// Standard error of what the rods remember, as a fraction of it.
pub const MEMORY_ERROR: f32 = 0.5;
/// Iterations from an apparent load to the load: each leaves an eighth of the error before it with the default `rod_memory`, a half
/// with the largest.
const ITERATIONS: u8 = 4;

/// How large the rods' memory is under a load (N) after a heavier one (N), over that of a light load after a much heavier
/// one; 0 if no heavier load has hung.
pub fn memory_shape(load_n: f32, heaviest_n: f32) -> f32 {
    ((heaviest_n - load_n) / MEMORY_COMPLETE_N).clamp(0.0, 1.0) * libm::expf(-load_n / MEMORY_FALLS_N)
}

/// What the rods remember.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RodMemory {
    /// How much heavier than it is a light load seems after a much heavier one, as a fraction of it: what the scene says.
    pub light: f32,
    /// The heaviest load that the rods have carried (N). Of what a load that swings pulls beyond its weight a half counts.
    pub heaviest_n: f32,
}

impl RodMemory {
    /// How much heavier than it is a load (N) seems, as a fraction of it.
    pub fn excess(&self, load_n: f32) -> f32 {
        self.light * memory_shape(load_n, self.heaviest_n)
    }

    /// The load (N) that twist and gap show when this one hangs.
    pub fn apparent_n(&self, load_n: f32) -> f32 {
        load_n * (1.0 + self.excess(load_n))
    }

    /// The load (N) that hangs when twist and gap show this one.
    pub fn load_n(&self, apparent_n: f32) -> f32 {
        (0..ITERATIONS).fold(apparent_n, |load_n, _| apparent_n / (1.0 + self.excess(load_n)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rods_remember_only_a_load_that_was_heavier() {
        assert_eq!((memory_shape(5.0, 5.0), memory_shape(5.0, 3.0)), (0.0, 0.0));
        // Complete after a load that was 4 N heavier or more, and half of it after one that was 2 N heavier.
        for (load_n, heaviest_n, fraction) in [(1.0, 5.0, 1.0), (1.0, 18.0, 1.0), (3.0, 5.0, 0.5)] {
            let expected = fraction * libm::expf(-load_n / MEMORY_FALLS_N);
            assert!(
                (memory_shape(load_n, heaviest_n) / expected - 1.0).abs() < 1e-6,
                "{load_n} N after {heaviest_n} N"
            );
        }
    }

    #[test]
    fn a_load_seems_heavier_after_a_heavier_one_and_is_found_from_what_it_seems() {
        for heaviest_n in [0.0f32, 5.0, 12.0, 18.0] {
            for light in [1e-6, 0.15, 0.5] {
                let memory = RodMemory { light, heaviest_n };
                for load_n in [0.5f32, 1.0, 3.0, 5.0, 8.0, 11.0, 17.9] {
                    let apparent_n = memory.apparent_n(load_n);
                    assert!(apparent_n >= load_n && (apparent_n > load_n || load_n >= heaviest_n || light < 1e-5));
                    let error = memory.load_n(apparent_n) / load_n - 1.0;
                    assert!(
                        error.abs() < 0.05 * MEMORY_ERROR * light + 1e-6,
                        "{load_n} N after {heaviest_n} N: {error}"
                    );
                }
            }
        }
    }
}
