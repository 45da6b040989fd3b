//! Maps of load and twist to [−1, 1].

/// The map of the load. The gap varies like 1/F at light loads (eq. 6), which no polynomial in F follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadMap {
    /// F/(F + b): one division, no transcendental function.
    Ratio {
        /// b (N).
        knee_n: f32,
    },
    /// ln F.
    Log,
    /// F^(−1/2).
    InverseRoot,
}

impl LoadMap {
    /// The mapped coordinate and its derivative by F. `load_n` must be above 0.
    #[inline]
    pub fn apply(self, load_n: f32) -> (f32, f32) {
        match self {
            Self::Ratio { knee_n } => {
                let inverse = 1.0 / (load_n + knee_n);
                (load_n * inverse, knee_n * inverse * inverse)
            }
            Self::Log => (libm::logf(load_n), 1.0 / load_n),
            Self::InverseRoot => {
                let root = 1.0 / libm::sqrtf(load_n);
                (root, -0.5 * root / load_n)
            }
        }
    }

    /// The load at a mapped coordinate, in f64 for the fit.
    #[cfg(feature = "std")]
    pub fn invert(self, coordinate: f64) -> f64 {
        match self {
            Self::Ratio { knee_n } => f64::from(knee_n) * coordinate / (1.0 - coordinate),
            Self::Log => coordinate.exp(),
            Self::InverseRoot => coordinate.powi(-2),
        }
    }

    /// The mapped coordinate in f64 for the fit.
    #[cfg(feature = "std")]
    pub fn apply_f64(self, load_n: f64) -> f64 {
        match self {
            Self::Ratio { knee_n } => load_n / (load_n + f64::from(knee_n)),
            Self::Log => load_n.ln(),
            Self::InverseRoot => load_n.powf(-0.5),
        }
    }
}

/// An affine map of a coordinate to [−1, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Middle of the range.
    pub centre: f32,
    /// 1 over half its width.
    pub inverse_half: f32,
}

impl Axis {
    /// The axis from `start` to `end`.
    pub fn new(start: f32, end: f32) -> Self {
        Self { centre: 0.5 * (start + end), inverse_half: 2.0 / (end - start) }
    }

    /// Position on the axis.
    #[inline]
    pub fn apply(self, coordinate: f32) -> f32 {
        (coordinate - self.centre) * self.inverse_half
    }

    /// Coordinate of a position, in f64 for the fit.
    #[cfg(feature = "std")]
    pub fn invert(self, position: f64) -> f64 {
        f64::from(self.centre) + position / f64::from(self.inverse_half)
    }
}
