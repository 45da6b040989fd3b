//! Numbers with units: from the operator, where a bare number is SI, and for people.

use std::f64::consts::{PI, TAU};

pub use rig_link::STANDARD_GRAVITY;

/// A unit: its name, and its size in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit(&'static str, f64);

macro_rules! units {
    ($($name:ident = $text:literal, $size:expr;)+) => {
        $(#[doc = concat!("The unit \"", $text, "\".")] pub const $name: Unit = Unit($text, $size);)+
    };
}

units! {
    NUMBER = "", 1.0;
    PERCENT = "%", 1e-2;
    M = "m", 1.0;
    MM = "mm", 1e-3;
    UM = "µm", 1e-6;
    NM = "nm", 1e-9;
    KN_PER_M = "kN/m", 1e3;
    MM_PER_S = "mm/s", 1e-3;
    MM_PER_N = "mm/N", 1e-3;
    N = "N", 1.0;
    KG = "kg", 1.0;
    MNM = "mNm", 1e-3;
    RAD = "rad", 1.0;
    TURNS = "turns", 1.0;
    TURNS_OF_RAD = "turns", TAU;
    RAD_PER_S = "rad/s", 1.0;
    RPM = "rpm", TAU / 60.0;
    RAD_PER_MM = "rad/mm", 1e3;
    S = "s", 1.0;
    MS = "ms", 1e-3;
    US = "µs", 1e-6;
    HZ = "Hz", 1.0;
    V = "V", 1.0;
    A = "A", 1.0;
    MA = "mA", 1e-3;
    PA = "Pa", 1.0;
}

/// A number that may be unknown: none, or not a number.
pub trait Value: Copy {
    /// The number, NaN if it is unknown.
    fn or_nan(self) -> f64;
}

impl Value for f64 {
    fn or_nan(self) -> f64 {
        self
    }
}

impl Value for f32 {
    fn or_nan(self) -> f64 {
        self.into()
    }
}

impl<T: Value> Value for Option<T> {
    fn or_nan(self) -> f64 {
        self.map_or(f64::NAN, T::or_nan)
    }
}

impl Unit {
    /// A measured or computed value (SI) for people: with four digits, and the unit.
    pub fn show(self, value: impl Value) -> String {
        self.rounded(value, f64::NAN)
    }

    /// A value and its error (SI) for people: the error with two digits, the value to the same decimal place. A value
    /// of unknown error has four digits.
    pub fn within(self, value: impl Value, error: impl Value) -> String {
        match value.or_nan().is_finite() && is_known(error.or_nan()) {
            true => format!("{} ± {}", self.number(value, error), self.error(error)),
            false => self.show(value),
        }
    }

    /// An error, or a bound of one (SI), for people: with two digits.
    pub fn error(self, error: impl Value) -> String {
        self.rounded(error, error)
    }

    /// A value (SI) to the decimal place of an error that is not stated, as a sensor's resolution.
    pub fn rounded(self, value: impl Value, error: impl Value) -> String {
        let number = self.number(value, error);
        if value.or_nan().is_finite() { self.named(number) } else { number }
    }

    /// The same without the unit, for a column that names it.
    pub fn number(self, value: impl Value, error: impl Value) -> String {
        let (value, error) = (value.or_nan() / self.1, error.or_nan().abs() / self.1);
        match value {
            _ if value.is_nan() => "unknown".to_owned(),
            _ if value.is_infinite() => "infinite".to_owned(),
            _ if is_known(error) => match (1e-4..1e7).contains(&value.abs().max(error)) {
                true => decimals(value, places(error, 2)),
                false => format!("{value:.*e}", (places(error, 2) - places(value, 1)).max(0) as usize),
            },
            0.0 => "0".to_owned(),
            _ if !(1e-4..1e7).contains(&value.abs()) => format!("{value:.2e}"),
            _ => decimals(value, places(value, 4).max(0)),
        }
    }

    /// An exact value (SI), as an operator gave it: at most five digits, without zeros at the end.
    pub fn exact(self, value: impl Value) -> String {
        let value = value.or_nan() / self.1;
        if !value.is_finite() {
            return self.show(value);
        }
        let text = decimals(value, places(value, 5).clamp(0, 12));
        let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        self.named(text.to_owned())
    }

    /// Two exact values (SI) with one unit.
    pub fn range(self, [low, high]: [impl Value; 2]) -> String {
        format!("{} to {}", Unit("", self.1).exact(low), self.exact(high))
    }

    fn named(self, number: String) -> String {
        format!("{number} {}", self.0).trim_end().to_owned()
    }
}

/// Whether it is the error of anything: a value that is exact, or of unknown error, has none.
fn is_known(error: f64) -> bool {
    error.is_finite() && error > 0.0
}

/// Decimal places that leave a value this many digits, once it is rounded to them; negative where tens are rounded.
fn places(value: f64, digits: usize) -> i32 {
    let rounded = format!("{value:.*e}", digits - 1);
    let exponent = rounded.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    if value == 0.0 { 0 } else { digits as i32 - 1 - exponent }
}

fn decimals(value: f64, places: i32) -> String {
    let step = 10f64.powi((-places).max(0));
    let text = format!("{:.*}", places.max(0) as usize, if places < 0 { (value / step).round() * step } else { value });
    // What is rounded to zero has no sign.
    if text.chars().all(|c| "-0.".contains(c)) { text.replace('-', "") } else { text }
}

/// What a number measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// m
    Length,
    /// m/s
    Speed,
    /// N, or a mass that hangs
    Load,
    /// N, no mass
    Force,
    /// rad
    Angle,
    /// rad/s
    AngularSpeed,
    /// s
    Time,
    /// Hz
    Frequency,
    /// V
    Voltage,
    /// A
    Current,
    /// N s/m
    Damping,
    /// a number, or per cent
    Fraction,
    /// a number
    Turns,
    /// N/m
    Stiffness,
    /// 1/N
    PerForce,
    /// N m
    Torque,
    /// Pa
    Stress,
    /// K, a difference
    Temperature,
    /// a number of anything else
    Number,
}

impl Quantity {
    /// Name, then accepted units; the first is the SI unit itself.
    const fn table(self) -> (&'static str, &'static [Unit]) {
        match self {
            Self::Length => ("length", &[M, MM, Unit("um", 1e-6), UM]),
            Self::Speed => ("speed", &[Unit("m/s", 1.0), MM_PER_S]),
            Self::Load => {
                ("load", &[N, Unit("mN", 1e-3), Unit("kg", STANDARD_GRAVITY), Unit("g", 1e-3 * STANDARD_GRAVITY)])
            }
            Self::Force => ("force", &[N, Unit("mN", 1e-3)]),
            Self::Angle => ("angle", &[RAD, Unit("mrad", 1e-3), Unit("deg", PI / 180.0)]),
            Self::AngularSpeed => ("angular speed", &[RAD_PER_S, Unit("deg/s", PI / 180.0), RPM]),
            Self::Time => ("time", &[S, MS]),
            Self::Frequency => ("frequency", &[HZ]),
            Self::Voltage => ("voltage", &[V, Unit("mV", 1e-3)]),
            Self::Current => ("current", &[A, MA]),
            Self::Damping => ("damping", &[Unit("Ns/m", 1.0), Unit("N*s/m", 1.0)]),
            Self::Fraction => ("fraction", &[PERCENT]),
            Self::Turns => ("number of turns", &[]),
            Self::Stiffness => ("stiffness", &[Unit("N/m", 1.0), KN_PER_M, Unit("N/mm", 1e3)]),
            Self::PerForce => ("value per newton", &[Unit("1/N", 1.0), Unit("1/kN", 1e-3)]),
            Self::Torque => ("torque", &[Unit("Nm", 1.0), Unit("N*m", 1.0), MNM, Unit("uNm", 1e-6)]),
            Self::Stress => ("stress", &[PA, Unit("kPa", 1e3), Unit("MPa", 1e6)]),
            Self::Temperature => ("difference of temperatures", &[Unit("K", 1.0)]),
            Self::Number => ("number", &[]),
        }
    }

    /// What a number in this SI unit measures; an empty or unknown unit is a plain number.
    pub fn of_unit(si: &str) -> Self {
        let all = [
            Self::Length,
            Self::Speed,
            Self::Load,
            Self::AngularSpeed,
            Self::Voltage,
            Self::Current,
            Self::Stiffness,
            Self::PerForce,
        ];
        all.into_iter().find(|quantity| quantity.table().1[0].0 == si).unwrap_or(Self::Number)
    }

    /// The units that are read, in words.
    pub fn units(self) -> String {
        let names: Vec<&str> = self.table().1.iter().map(|unit| unit.0).collect();
        match (self, names.first()) {
            (Self::Fraction, _) => "a bare number, or %".into(),
            (_, Some(si)) => format!("{} (a bare number is {si})", names.join(", ")),
            (_, None) => "a bare number".into(),
        }
    }

    /// An exact value for people: lengths in mm, stiffnesses from 1 kN/m in kN/m, stresses in MPa, torques in mNm, all
    /// else in SI.
    pub fn show(self, value: f64) -> String {
        let unit = match self {
            Self::Length => MM,
            Self::Stiffness if value.abs() >= 1e3 => KN_PER_M,
            Self::Stress => Unit("MPa", 1e6),
            Self::Torque => MNM,
            Self::Fraction => NUMBER,
            _ => self.table().1.first().copied().unwrap_or(NUMBER),
        };
        unit.exact(value)
    }
}

/// Why a text is not such a quantity.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// No number, or another unit.
    #[error("{parameter}: `{text}` is not a {name}; units: {units}")]
    NotOne {
        /// Which parameter.
        parameter: String,
        /// What was given.
        text: String,
        /// What it should measure.
        name: &'static str,
        /// Accepted units.
        units: String,
    },
    /// Infinite, not a number, or beyond what the board's numbers hold.
    #[error("{parameter}: `{text}` is not a finite number, or beyond single precision")]
    NotFinite {
        /// Which parameter.
        parameter: String,
        /// What was given.
        text: String,
    },
}

/// Reads a number with or without a unit into SI.
///
/// # Errors
/// [`UnitError`] naming the parameter and the accepted units.
pub fn parse(parameter: &str, quantity: Quantity, text: &str) -> Result<f64, UnitError> {
    let (name, units) = quantity.table();
    let trimmed = text.trim();
    // A text may end in several units ("12mm" also ends in "m"); only one of them leaves a number.
    let with_unit = || {
        units.iter().find_map(|Unit(unit, size)| {
            let number: f64 = trimmed.strip_suffix(unit)?.trim_end().parse().ok()?;
            Some(number * size)
        })
    };
    let value = trimmed.parse::<f64>().ok().or_else(with_unit).ok_or_else(|| UnitError::NotOne {
        parameter: parameter.into(),
        text: text.into(),
        name,
        units: quantity.units(),
    })?;
    // Beyond f32 the board would see infinity.
    if !value.is_finite() || value.abs() > f64::from(f32::MAX) {
        return Err(UnitError::NotFinite { parameter: parameter.into(), text: text.into() });
    }
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn reads(quantity: Quantity, text: &str, expected: f64) {
        let value = parse("x", quantity, text).unwrap_or_else(|e| panic!("{e}"));
        assert!((value - expected).abs() <= 1e-12 * expected.abs(), "{text}: {value}, not {expected}");
    }

    #[test]
    fn units_and_bare_numbers() {
        reads(Quantity::Length, "12mm", 0.012);
        reads(Quantity::Length, "-1.5 m", -1.5);
        reads(Quantity::Length, "50um", 50e-6);
        reads(Quantity::Length, "50µm", 50e-6);
        reads(Quantity::Length, "0.012", 0.012);
        reads(Quantity::Length, "1.2e-2m", 0.012);
        reads(Quantity::Speed, "2mm/s", 0.002);
        reads(Quantity::Load, "0.5kg", 4.903_325);
        reads(Quantity::Load, "100g", 0.980_665);
        reads(Quantity::Load, "4.9N", 4.9);
        reads(Quantity::Angle, "180deg", PI);
        reads(Quantity::AngularSpeed, "60rpm", TAU);
        reads(Quantity::Fraction, "1%", 0.01);
        reads(Quantity::Torque, "0.2mNm", 2e-4);
        reads(Quantity::Stress, "60 MPa", 60e6);
        reads(Quantity::Temperature, "-5K", -5.0);
        reads(Quantity::Turns, "7.5", 7.5);
    }

    #[test]
    fn quantities_by_their_si_unit() {
        for quantity in [Quantity::Length, Quantity::Load, Quantity::Current, Quantity::Stiffness, Quantity::PerForce] {
            assert_eq!(Quantity::of_unit(quantity.table().1[0].0), quantity);
        }
        assert_eq!(Quantity::of_unit(""), Quantity::Number);
        reads(Quantity::of_unit("N/m"), "1.37kN/m", 1370.0);
        reads(Quantity::of_unit("1/N"), "6522 1/kN", 6.522);
        assert!(parse("string.k2", Quantity::of_unit(""), "1mm").is_err());
    }

    #[test]
    fn shown_for_people() {
        for (quantity, value, text) in [
            (Quantity::Length, 0.00045, "0.45 mm"),
            (Quantity::Stiffness, 10.0, "10 N/m"),
            (Quantity::Stiffness, 1370.0, "1.37 kN/m"),
            (Quantity::Load, 7.5, "7.5 N"),
            (Quantity::Number, 0.0, "0"),
            (Quantity::Number, 123_456.7, "123457"),
            (Quantity::Length, 0.1 + 0.2, "300 mm"),
        ] {
            assert_eq!(quantity.show(value), text);
        }
    }

    #[test]
    fn an_error_says_how_many_digits_a_value_has() {
        for (unit, value, error, text) in [
            (N, 1.9618, 0.0312, "1.962 ± 0.031 N"),
            (MM, 12.0034e-3, 0.12e-3, "12.00 ± 0.12 mm"),
            // Rounding adds a digit in front of the point.
            (N, 9.996, 0.01, "9.996 ± 0.010 N"),
            (N, 9.996, 0.1, "10.00 ± 0.10 N"),
            (N, 9.996, 0.0996, "10.00 ± 0.10 N"),
            (N, 3.0, 0.996, "3.0 ± 1.0 N"),
            // Larger than the value; tens; zero; negative.
            (N, 0.02, 1.34, "0.0 ± 1.3 N"),
            (UM, 4321e-6, 126e-6, "4320 ± 130 µm"),
            (UM, 0.0, 2.5e-6, "0.0 ± 2.5 µm"),
            (UM, -0.04e-6, 2.5e-6, "0.0 ± 2.5 µm"),
            (MM, -1.5e-3, 20e-6, "-1.500 ± 0.020 mm"),
            (N, 1.5, 0.0, "1.500 N"),
            (PA, 4.5123e10, 2.31e8, "4.512e10 ± 2.3e8 Pa"),
            (N, f64::NAN, 0.1, "unknown"),
            (N, 1.5, f64::NAN, "1.500 N"),
            (N, 1.5, f64::INFINITY, "1.500 N"),
        ] {
            assert_eq!(unit.within(value, error), text);
        }
    }

    #[test]
    fn a_value_of_unknown_error_has_four_digits() {
        for (unit, value, text) in [
            (N, 9.996, "9.996 N"),
            (N, 9.9996, "10.00 N"),
            (N, 0.0, "0 N"),
            (N, -0.0, "0 N"),
            (MM, -0.000_123_456, "-0.1235 mm"),
            (NUMBER, 12_345.6, "12346"),
            (NUMBER, 3.14e-12, "3.14e-12"),
            (PA, 4.5e10, "4.50e10 Pa"),
            (RAD_PER_MM, f64::INFINITY, "infinite"),
            (PERCENT, 0.0123, "1.230 %"),
            (RPM, 30.0 * TAU / 60.0, "30.00 rpm"),
        ] {
            assert_eq!(unit.show(value), text);
        }
        assert_eq!((N.show(None::<f32>), N.show(Some(0.5f32))), ("unknown".to_owned(), "0.5000 N".to_owned()));
        assert_eq!([MM.number(1e-3, f64::NAN), MM.number(1e-3, 1e-5)], ["1.000", "1.000"]);
        assert_eq!(
            (MM.exact(0.5e-3), N.exact(18.0f32), N.exact(f64::NAN)),
            ("0.5 mm".into(), "18 N".into(), "unknown".into())
        );
    }

    #[test]
    fn refusals_name_parameter_and_units() {
        for text in ["", "mm", "12", "12 furlongs", "1,5mm/s", "2mm"].into_iter().filter(|t| *t != "12") {
            let message = parse("speed", Quantity::Speed, text).expect_err(text).to_string();
            assert!(message.contains("speed") && message.contains("mm/s"), "{message}");
        }
        assert!(parse("load", Quantity::Length, "0.5kg").is_err());
        assert!(parse("turns", Quantity::Turns, "7.5mm").is_err());
    }

    #[test]
    fn only_finite() {
        for text in ["nan", "inf", "-inf", "infinity", "1e400", "infmm", "nanmm", "1e39"] {
            let error = parse("to", Quantity::Length, text).expect_err(text);
            assert!(matches!(error, UnitError::NotFinite { .. }), "{error}");
        }
    }
}
