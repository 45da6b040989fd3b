//! The middle of an even curve, from two sweeps across it in opposite directions.

use super::SWEEP_HALF;
use super::sweeps::{Bin, Sweeps};
use crate::observer::TRAVEL_M;
use micromath::F32Ext;
use rig_link::messages::HomingFailure;

/// Bins across the sweep.
pub(super) const BINS: usize = 48;
/// Levels whose midpoints are averaged.
const LEVELS: usize = 16;
/// Largest disagreement between the two directions, as a fraction of half the sweep: beyond it the load hardly follows.
const LARGEST_SPLIT: f32 = 0.9;

/// The middle of both sweeps (rad) and its estimated error (rad). Friction makes the two directions differ. Half of that
/// difference would be an upper bound of the error if it did not cancel; a tenth of it is counted, besides the scatter of the
/// midpoints.
///
/// # Errors
/// [`HomingFailure::NoPretwist`] if a sweep shows no maximum, [`HomingFailure::PoorFit`] if the two disagree.
pub(super) fn middle(sweeps: &Sweeps<BINS>) -> Result<(f32, f32), HomingFailure> {
    let [first, second] = &sweeps.bins;
    let (first, second) = (middle_of_sweep(first)?, middle_of_sweep(second)?);
    if (first.0 - second.0).abs() > LARGEST_SPLIT * SWEEP_HALF {
        return Err(HomingFailure::PoorFit);
    }
    // The error is an estimate: micromath's root, 6 % off at most, is good enough for it.
    let scatter = F32Ext::sqrt(0.5 * (first.1 * first.1 + second.1 * second.1));
    let error = 0.05 * (first.0 - second.0).abs() + scatter / F32Ext::sqrt(LEVELS as f32);
    Ok((0.5 * (first.0 + second.0), error))
}

/// Mean and scatter (rad) of the midpoints between equal gaps on both sides of one sweep's maximum.
fn middle_of_sweep(bins: &[Bin; BINS]) -> Result<(f32, f32), HomingFailure> {
    let mut curve = heapless::Vec::<(f32, f32), BINS>::new();
    for bin in bins.iter().filter(|b| b.count > 0) {
        let per = 1.0 / f32::from(bin.count);
        // There are as many places as bins, so this cannot fail.
        let _ = curve.push((bin.angle_sum * per, bin.gap_sum * per));
    }
    let top_at = (1..curve.len()).fold(0, |top, k| if curve[k].1 > curve[top].1 { k } else { top });
    let (Some(left), Some(right), Some(top)) = (curve.first(), curve.last(), curve.get(top_at)) else {
        return Err(HomingFailure::NoPretwist);
    };
    let (top, floor) = (top.1, left.1.max(right.1));
    // A flat curve has no middle.
    if top - floor < TRAVEL_M {
        return Err(HomingFailure::NoPretwist);
    }
    let (mut sum, mut squares, mut count) = (0.0, 0.0, 0u16);
    for k in 0..LEVELS {
        let level = floor + (top - floor) * (0.1 + 0.75 * k as f32 / LEVELS as f32);
        let rise = crossing(curve[..=top_at].iter(), level);
        let fall = crossing(curve[top_at..].iter().rev(), level);
        if let (Some(a), Some(b)) = (rise, fall) {
            let middle = 0.5 * (a + b);
            sum += middle;
            squares += middle * middle;
            count += 1;
        }
    }
    if usize::from(count) < LEVELS / 2 {
        return Err(HomingFailure::NoPretwist);
    }
    let mean = sum / f32::from(count);
    Ok((mean, F32Ext::sqrt((squares / f32::from(count) - mean * mean).max(0.0))))
}

/// Where a rising run of points crosses a level.
fn crossing<'a>(mut points: impl Iterator<Item = &'a (f32, f32)>, level: f32) -> Option<f32> {
    let mut last = *points.next()?;
    for point in points {
        if last.1 <= level && point.1 > level {
            return Some(last.0 + (point.0 - last.0) * (level - last.1) / (point.1 - last.1));
        }
        last = *point;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sweep(zero: f32, lag: f32, height: f32) -> Sweeps<BINS> {
        let mut sweeps = Sweeps::NEW;
        for (pass, sign) in [(0, 1.0f32), (1, -1.0)] {
            assert_eq!(sweeps.pass, pass);
            for k in 0..=1000 {
                let shaft = sign * (k as f32 / 100.0 - 5.0);
                let twist = shaft - lag * sign - zero;
                sweeps.record(0.1 * shaft + 0.5, shaft, 0.1 - height * (1.0 - libm::cosf(twist / 2.0)));
            }
            assert_eq!(sweeps.end_pass(), pass == 1);
        }
        sweeps
    }

    #[test]
    fn the_middle_is_found_and_lag_cancels() {
        for (zero, lag) in [(0.0, 0.0), (0.4, 0.0), (-0.7, 0.05), (0.1, 0.2)] {
            let (found, error) = middle(&sweep(zero, lag, 0.004)).unwrap();
            assert!((found - zero).abs() < 3e-3, "{found} for {zero} with lag {lag}");
            assert!(error < 0.05);
        }
    }

    #[test]
    fn what_is_flat_or_one_sided_or_split_is_refused() {
        assert_eq!(middle(&sweep(0.0, 0.0, 1e-5)), Err(HomingFailure::NoPretwist));
        assert_eq!(middle(&sweep(6.0, 0.0, 0.004)), Err(HomingFailure::NoPretwist));
        assert_eq!(middle(&sweep(0.0, 2.4, 0.02)), Err(HomingFailure::PoorFit));
        assert_eq!(middle(&Sweeps::NEW), Err(HomingFailure::NoPretwist));
    }
}
