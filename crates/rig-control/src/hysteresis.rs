//! Hysteresis of the rods: by how much a load is taken wrong after a heavier one has hung.

/// Rods that have carried a heavier load remember it: on the way down their stress is lower, which looks like 0.4, 1.3 and
/// 1.0 N at 1, 5 and 10 N (crates/rig-plant/README.md). The load (N) over which the fraction of a light load falls.
const MEMORY_FALLS_N: f32 = 7.0;
/// How far below the heaviest load (N) what the rods remember is complete.
pub const MEMORY_COMPLETE_N: f32 = 4.0;

/// How large the rods' memory is under a load (N) after a heavier one (N), over that of a light load after a much heavier
/// one; 0 if no heavier load has hung.
pub fn memory_shape(load_n: f32, heaviest_n: f32) -> f32 {
    ((heaviest_n - load_n) / MEMORY_COMPLETE_N).clamp(0.0, 1.0) * libm::expf(-load_n / MEMORY_FALLS_N)
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
}
