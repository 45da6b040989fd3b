//! The few elementary functions the model needs: std's on a desktop, libm's on the board.

#[cfg(feature = "std")]
mod imp {
    pub fn sqrt(x: f64) -> f64 {
        x.sqrt()
    }
    pub fn sin_cos(x: f64) -> (f64, f64) {
        x.sin_cos()
    }
    pub fn sin(x: f64) -> f64 {
        x.sin()
    }
    pub fn asin(x: f64) -> f64 {
        x.asin()
    }
    pub fn powf(x: f64, y: f64) -> f64 {
        x.powf(y)
    }
}

#[cfg(not(feature = "std"))]
mod imp {
    pub fn sqrt(x: f64) -> f64 {
        libm::sqrt(x)
    }
    pub fn sin_cos(x: f64) -> (f64, f64) {
        libm::sincos(x)
    }
    pub fn sin(x: f64) -> f64 {
        libm::sin(x)
    }
    pub fn asin(x: f64) -> f64 {
        libm::asin(x)
    }
    pub fn powf(x: f64, y: f64) -> f64 {
        libm::pow(x, y)
    }
}

pub(crate) use imp::*;
