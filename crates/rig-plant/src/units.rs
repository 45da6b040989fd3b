//! Numbers with units from the operator. A bare number is SI.

use std::f64::consts::{PI, TAU};

/// Standard gravity (m/s², CODATA): what turns a mass into a load.
pub const STANDARD_GRAVITY: f64 = 9.806_65;

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
    /// Name, then accepted units with their factors to SI; the first is the SI unit itself.
    const fn table(self) -> (&'static str, &'static [(&'static str, f64)]) {
        match self {
            Self::Length => ("length", &[("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("µm", 1e-6)]),
            Self::Speed => ("speed", &[("m/s", 1.0), ("mm/s", 1e-3)]),
            Self::Load => {
                ("load", &[("N", 1.0), ("mN", 1e-3), ("kg", STANDARD_GRAVITY), ("g", 1e-3 * STANDARD_GRAVITY)])
            }
            Self::Force => ("force", &[("N", 1.0), ("mN", 1e-3)]),
            Self::Angle => ("angle", &[("rad", 1.0), ("mrad", 1e-3), ("deg", PI / 180.0)]),
            Self::AngularSpeed => ("angular speed", &[("rad/s", 1.0), ("deg/s", PI / 180.0), ("rpm", TAU / 60.0)]),
            Self::Time => ("time", &[("s", 1.0), ("ms", 1e-3)]),
            Self::Voltage => ("voltage", &[("V", 1.0), ("mV", 1e-3)]),
            Self::Current => ("current", &[("A", 1.0), ("mA", 1e-3)]),
            Self::Damping => ("damping", &[("Ns/m", 1.0), ("N*s/m", 1.0)]),
            Self::Fraction => ("fraction", &[("%", 1e-2)]),
            Self::Turns => ("number of turns", &[]),
            Self::Stiffness => ("stiffness", &[("N/m", 1.0), ("kN/m", 1e3), ("N/mm", 1e3)]),
            Self::PerForce => ("value per newton", &[("1/N", 1.0), ("1/kN", 1e-3)]),
            Self::Torque => ("torque", &[("Nm", 1.0), ("N*m", 1.0), ("mNm", 1e-3), ("uNm", 1e-6)]),
            Self::Stress => ("stress", &[("Pa", 1.0), ("kPa", 1e3), ("MPa", 1e6)]),
            Self::Temperature => ("difference of temperatures", &[("K", 1.0)]),
            Self::Number => ("number", &[]),
        }
    }

    /// What a number in this SI unit measures; an empty or unknown unit is a plain number.
    pub fn of_unit(si: &str) -> Self {
        let all = [
            Self::Length,
            Self::Speed,
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
        let names: Vec<&str> = self.table().1.iter().map(|(name, _)| *name).collect();
        match (self, names.first()) {
            (Self::Fraction, _) => "a bare number, or %".into(),
            (_, Some(si)) => format!("{} (a bare number is {si})", names.join(", ")),
            (_, None) => "a bare number".into(),
        }
    }

    /// A value for people: lengths in mm, stiffnesses from 1 kN/m in kN/m, all else in SI; at most five digits.
    pub fn show(self, value: f64) -> String {
        let (factor, unit) = match self {
            Self::Length => (1e-3, "mm"),
            Self::Stiffness if value.abs() >= 1e3 => (1e3, "kN/m"),
            _ => (1.0, self.table().1.first().map_or("", |(si, _)| si)),
        };
        format!("{} {unit}", digits(value / factor)).trim_end().to_owned()
    }
}

/// At most five digits, without zeros at the end.
fn digits(value: f64) -> String {
    let places = (4.0 - value.abs().log10().floor()).clamp(0.0, 12.0);
    let text = format!("{value:.*}", if value == 0.0 { 0 } else { places as usize });
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
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
        units.iter().find_map(|(unit, factor)| {
            let number: f64 = trimmed.strip_suffix(unit)?.trim_end().parse().ok()?;
            Some(number * factor)
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
        for quantity in [Quantity::Length, Quantity::Speed, Quantity::Current, Quantity::Stiffness, Quantity::PerForce]
        {
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
