//! Small systems of linear equations.

/// 1, x, x², x³.
pub(super) fn powers(x: f64) -> [f64; 4] {
    [1.0, x, x * x, x * x * x]
}

/// Solves a x = b by elimination with the greatest pivot of each column.
pub(super) fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for k in 0..N {
        let pivot = (k..N).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).unwrap_or(k);
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..N {
            let share = a[i][k] / a[k][k];
            let row = a[k];
            a[i].iter_mut().zip(row).for_each(|(cell, above)| *cell -= share * above);
            b[i] -= share * b[k];
        }
    }
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_are_solved_whatever_their_order() {
        let a = [[0.0, 2.0, 1.0], [1.0, -1.0, 0.0], [3.0, 0.0, -2.0]];
        let x = [1.0, 2.0, 3.0];
        let b = a.map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum());
        assert!(solve(a, b).iter().zip(x).all(|(found, x)| (found - x).abs() < 1e-12));
    }
}
