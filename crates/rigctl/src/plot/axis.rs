//! An axis: its scale, and ticks at round values.

use super::draw::width_of;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// One axis.
#[derive(Debug, Clone)]
pub struct Axis {
    pub(super) label: String,
    low: f64,
    high: f64,
    log: bool,
    ticks: Vec<(f64, String)>,
}
impl Axis {
    /// Equal steps, with a little room at both ends so that marks there stay whole.
    pub fn linear(label: impl Into<String>, [low, high]: [f64; 2]) -> Self {
        // One value alone gets room around it.
        let width = if high - low > 1e-9 * low.abs() { high - low } else { low.abs().max(1e-3) };
        let (low, high) = (low - 0.04 * width, high + 0.04 * width);
        let decade = 10f64.powf(width.log10().floor());
        let inside = |step: f64| (low / step).ceil() as i64..=(high / step).floor() as i64;
        let steps = [5.0, 2.5, 2.0, 1.0, 0.5, 0.25, 0.2, 0.1].map(|m| m * decade);
        let step = steps.into_iter().find(|step| inside(*step).count() >= 4).unwrap_or(width);
        let places = (2.0 - step.log10()).clamp(0.0, 12.0) as usize;
        let ticks = inside(step).map(|k| k as f64 * step).map(|v| (v, plain(v, places))).collect();
        Self { label: label.into(), low, high, log: false, ticks }
    }

    /// Equal ratios; both limits above 0.
    pub fn log(label: impl Into<String>, [low, high]: [f64; 2]) -> Self {
        let low = low.max(f64::MIN_POSITIVE);
        let room = (high.max(low) / low).powf(0.05).max(1.05);
        let (low, high) = (low / room, high.max(low) * room);
        let decades = (high / low).log10();
        if decades > 5.0 {
            let every = (decades / 6.0).ceil() as i32;
            let powers = (low.log10().ceil() as i32..=high.log10().floor() as i32).filter(|k| k % every == 0);
            let ticks = powers.map(|k| (10f64.powi(k), power_of_ten(k))).collect();
            return Self { label: label.into(), low, high, log: true, ticks };
        }
        // As decimals their names would run into each other.
        let (small, large) = (decades >= 2.2 && low < 1e-4, decades >= 2.2 && high > 1e5);
        let steps: &[f64] = if decades < 2.2 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let ticks = (low.log10().floor() as i32..=high.log10().ceil() as i32)
            .flat_map(|k| steps.iter().map(move |s| s * 10f64.powi(k)))
            .filter(|v| (low..=high).contains(v))
            .map(|v| (v, if small || large { power_of_ten(v.log10().round() as i32) } else { plain(v, 12) }));
        Self { label: label.into(), low, high, log: true, ticks: ticks.collect() }
    }

    /// Exactly between these limits, without room at the ends: for what fills the whole plane.
    pub fn tight(self, [low, high]: [f64; 2]) -> Self {
        let ticks = self.ticks.into_iter().filter(|(v, _)| (low..=high).contains(v)).collect();
        Self { low, high, ticks, ..self }
    }

    /// Ticks without their names, and no label: where a neighbour names them.
    pub fn unnamed(self) -> Self {
        let ticks = self.ticks.into_iter().map(|(v, _)| (v, String::new())).collect();
        Self { label: String::new(), ticks, ..self }
    }

    /// The same limits with ticks that are named.
    pub fn ticked(self, ticks: impl IntoIterator<Item = (f64, String)>) -> Self {
        Self { ticks: ticks.into_iter().collect(), ..self }
    }

    /// Names from top to bottom, the `k`th at −k.
    pub fn names<T: Into<String>>(names: impl IntoIterator<Item = T>) -> Self {
        let ticks: Vec<(f64, String)> = names.into_iter().enumerate().map(|(k, n)| (-(k as f64), n.into())).collect();
        Self { label: String::new(), low: 0.4 - ticks.len() as f64, high: 0.6, log: false, ticks }
    }

    /// Where the `k`th of `of` marks of one of these names stands: above each other, so that none hides another.
    pub fn row(name: usize, k: usize, of: usize) -> f64 {
        0.3 - 0.6 * (k as f64 + 0.5) / of as f64 - name as f64
    }

    /// Where a value stands on a straight scale.
    fn place(&self, value: f64) -> f64 {
        if self.log { value.max(f64::MIN_POSITIVE).ln() } else { value }
    }

    pub(super) fn widest_tick(&self) -> i32 {
        self.ticks.iter().map(|(_, name)| width_of(name)).max().unwrap_or(0)
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let [low, high, place] = [self.low, self.high, *value].map(|v| self.place(v));
        from + (f64::from(to - from) * (place - low) / (high - low)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        // There are no lines between the ticks.
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.iter().map(|(v, _)| *v).collect() }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.ticks.iter().find(|(v, _)| v == value).map(|(_, name)| name.clone()).unwrap_or_default()
    }
}

/// 10 to a power.
fn power_of_ten(k: i32) -> String {
    let raised = |c| match c {
        '-' => '⁻',
        digit => "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().nth(digit as usize - '0' as usize).unwrap_or(digit),
    };
    format!("10{}", k.to_string().chars().map(raised).collect::<String>())
}

/// A number with at most the given number of decimal places and none that are zero.
fn plain(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.replace('-', "−") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let names = |axis: &Axis| axis.ticks.iter().map(|(_, name)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&Axis::linear("", [0.0, 37.0])), ["0", "10", "20", "30"]);
        assert_eq!(names(&Axis::linear("", [-0.02, 0.02])), ["−0.02", "−0.01", "0", "0.01", "0.02"]);
        assert_eq!(names(&Axis::linear("", [0.0, 7.5])), ["0", "2.5", "5", "7.5"]);
        assert_eq!(names(&Axis::log("", [0.4, 8.0])), ["0.5", "1", "2", "5"]);
        assert_eq!(names(&Axis::log("", [0.4, 500.0])), ["1", "10", "100"]);
        assert_eq!(names(&Axis::log("", [1e-14, 1e-3])), ["10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³"]);
        assert_eq!(names(&Axis::linear("", [0.0, 7.5]).tight([0.0, 6.0])), ["0", "2.5", "5"]);
        assert!(names(&Axis::linear("", [3.0, 3.0])).contains(&"3".to_owned()));
        assert!(!names(&Axis::linear("", [0.0, 0.0])).is_empty());
    }
}
