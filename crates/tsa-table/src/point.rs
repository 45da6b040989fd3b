//! What a lookup returns.

/// The mechanism at a load and a twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Gap G between the clamps (m).
    pub gap_m: f32,
    /// ∂G/∂θ at constant load (m/rad), negative.
    pub dgap_dtwist_m_per_rad: f32,
    /// ∂G/∂F at constant twist (m/N), positive.
    pub dgap_dload_m_per_n: f32,
}

impl Point {
    /// TR = −1/(∂G/∂θ) (rad/m), eq. 29.
    #[inline]
    pub fn tr_rad_per_m(&self) -> f32 {
        -1.0 / self.dgap_dtwist_m_per_rad
    }
}
