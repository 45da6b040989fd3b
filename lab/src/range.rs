//! Ranges from the operator: `D0=8mm..32mm:5`, `K=10..10000:4log`, `0..7.5`.

use crate::scene_key;
use rigctl::units::{self, Quantity};
use std::str::FromStr;

/// Maximum values of one study.
const MAX: u32 = 1000;
/// Number of values if the operator gives none.
const USUAL: u32 = 5;

/// One key of a scene and the values that it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Vary {
    /// The key as in a scene file.
    pub key: String,
    from: f64,
    to: f64,
    count: u32,
    log: bool,
}

impl Vary {
    /// The values (SI), the limits exactly as given.
    pub fn values(&self) -> Vec<f64> {
        let last = self.count - 1;
        (0..self.count)
            .map(|k| match f64::from(k) / f64::from(last.max(1)) {
                _ if k == 0 => self.from,
                _ if k == last => self.to,
                part if self.log => self.from * (self.to / self.from).powf(part),
                part => self.from + part * (self.to - self.from),
            })
            .collect()
    }
}

impl FromStr for Vary {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || format!("vary: `{text}` is not KEY=FROM..TO[:COUNT[log]], for example D0=8mm..32mm:5");
        let (name, range) = text.split_once('=').ok_or_else(form)?;
        let name = name.trim();
        let key = scene_key::full_name(name).to_owned();
        let quantity = scene_key::quantity(&key);
        let (limits, count) = match range.rsplit_once(':') {
            Some((limits, count)) => (limits, Some(count.trim())),
            None => (range, None),
        };
        let [from, to] = limits_of(name, quantity, limits).map_err(|e| e.unwrap_or_else(form))?;
        let (count, log) = match count {
            Some(count) => match count.strip_suffix("log") {
                Some("") => (USUAL, true),
                number => (self::count(name, number.unwrap_or(count))?, number.is_some()),
            },
            None => (USUAL, false),
        };
        if log && !(from > 0.0 && to > 0.0) {
            return Err(format!("{name}: equal ratios need limits above 0, not {limits}"));
        }
        if count == 1 && from != to {
            return Err(format!(
                "{name}: one value cannot reach from {} to {}",
                quantity.show(from),
                quantity.show(to)
            ));
        }
        Ok(Self { key, from, to, count, log })
    }
}

fn count(name: &str, text: &str) -> Result<u32, String> {
    let count = text.parse::<u32>().ok().filter(|count| (1..=MAX).contains(count));
    count.ok_or_else(|| format!("{name}: `{text}` is not a number of values from 1 to {MAX}"))
}

/// The two limits; `Err(None)` if there are not two.
fn limits_of(name: &str, quantity: Quantity, text: &str) -> Result<[f64; 2], Option<String>> {
    let (from, to) = text.split_once("..").ok_or(None)?;
    let limit = |text: &str| units::parse(name, quantity, text).map_err(|e| Some(e.to_string()));
    Ok([limit(from)?, limit(to)?])
}

/// Reads turns past the half-turn pre-twist, from fewer to more.
///
/// # Errors
/// In words, if there are not two in this order.
pub fn turn_range(text: &str) -> Result<[f64; 2], String> {
    let form = || format!("turns: `{text}` is not FROM..TO, for example 0..7.5");
    let [from, to] = limits_of("turns", Quantity::Turns, text).map_err(|e| e.unwrap_or_else(form))?;
    if from < to { Ok([from, to]) } else { Err(format!("turns: {to} is not more than {from}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_ranges() {
        let values = |text: &str| text.parse::<Vary>().unwrap_or_else(|e| panic!("{e}")).values();
        assert_eq!(values("c=2mm..6mm:3"), [0.002, 0.004, 0.006]);
        assert_eq!(values("R=0.4mm..0.6mm").len(), 5);
        assert_eq!(values("k2=0.5..0.5:1"), [0.5]);
        let ratios = values("string.stiffness_n_per_m=10..10kN/m:4log");
        assert_eq!([ratios[0], ratios[3]], [10.0, 10e3]);
        assert!((ratios[1] - 100.0).abs() < 1e-9 && (ratios[2] - 1000.0).abs() < 1e-9);
        assert_eq!(values("K=1..16:log").len(), 5);
    }

    #[test]
    fn refusals_name_the_parameter() {
        for (text, named) in [
            ("D0", "vary"),
            ("D0=8mm", "vary"),
            ("D0=8..32:0", "D0"),
            ("D0=8..32:many", "many"),
            ("D0=8..32:1001", "1000"),
            ("D0=8kg..32mm", "D0"),
            ("K=0..10:3log", "K"),
            ("K=1..2:1", "K"),
            ("r0=nan..1", "r0"),
        ] {
            let message = text.parse::<Vary>().unwrap_err();
            assert!(message.contains(named), "{text}: {message}");
        }
        for text in ["7.5", "7..1", "0..x", "1..1"] {
            assert!(turn_range(text).unwrap_err().contains("turns"), "{text}");
        }
    }
}
