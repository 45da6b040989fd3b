//! Symmetric positive definite systems of a few unknowns, by Cholesky's decomposition.

/// A matrix's lower triangle L with A = L Lᵀ.
#[derive(Clone, Copy, Debug)]
pub struct Cholesky<const N: usize>([[f32; N]; N]);

impl<const N: usize> Cholesky<N> {
    /// Of a symmetric matrix, whose lower triangle is read; `None` if it is not positive definite.
    pub fn new(mut a: [[f32; N]; N]) -> Option<Self> {
        for i in 0..N {
            for j in 0..=i {
                let sum = a[i][j] - (0..j).map(|k| a[i][k] * a[j][k]).sum::<f32>();
                if i != j {
                    a[i][j] = sum / a[j][j];
                } else if sum > 0.0 && sum.is_finite() {
                    a[i][i] = libm::sqrtf(sum);
                } else {
                    return None;
                }
            }
        }
        Some(Self(a))
    }

    /// The solution of A x = b.
    pub fn solve(&self, mut b: [f32; N]) -> [f32; N] {
        let l = &self.0;
        for i in 0..N {
            let known: f32 = (0..i).map(|k| l[i][k] * b[k]).sum();
            b[i] = (b[i] - known) / l[i][i];
        }
        for i in (0..N).rev() {
            let known: f32 = (i + 1..N).map(|k| l[k][i] * b[k]).sum();
            b[i] = (b[i] - known) / l[i][i];
        }
        b
    }

    /// The inverse of A: the covariance, where A is the information.
    pub fn inverse(&self) -> [[f32; N]; N] {
        core::array::from_fn(|j| self.solve(core::array::from_fn(|i| if i == j { 1.0 } else { 0.0 })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_is_solved_and_its_matrix_inverted() {
        let a = [[4.0, 0.0, 0.0], [2.0, 5.0, 0.0], [-1.0, 1.5, 3.0]];
        let decomposed = Cholesky::new(a).expect("positive definite");
        let x = decomposed.solve([1.0, 2.0, 3.0]);
        let full = |i: usize, j: usize| if i >= j { a[i][j] } else { a[j][i] };
        for i in 0..3 {
            let back: f32 = (0..3).map(|j| full(i, j) * x[j]).sum();
            assert!((back - [1.0, 2.0, 3.0][i]).abs() < 1e-5, "{x:?}");
        }
        let inverse = decomposed.inverse();
        for i in 0..3 {
            for j in 0..3 {
                let product: f32 = (0..3).map(|k| full(i, k) * inverse[k][j]).sum();
                assert!((product - if i == j { 1.0 } else { 0.0 }).abs() < 1e-5, "{inverse:?}");
            }
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        assert!(Cholesky::new([[1.0, 0.0], [2.0, 1.0]]).is_none());
        assert!(Cholesky::new([[0.0]]).is_none() && Cholesky::new([[f32::NAN]]).is_none());
    }
}
