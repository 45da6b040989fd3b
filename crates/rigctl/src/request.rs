//! Requests as people and programs write them: a line of a script or of a log, `move 0.008 speed=0.002 load=auto`, and an
//! object of a client of `serve`, `{"do": "move", "to_m": 0.008, "speed_m_per_s": 0.002}`.

use crate::board_settings;
use crate::trajectory::HOLDS_FOR_S;
use crate::units::{self, Quantity};
use rig_link::{LoadChoice, Request};
use serde_json::{Map, Value};

/// A value of a request.
pub struct Field {
    /// Its key in an object.
    key: &'static str,
    /// What stands before its `=` in a script, and what after it; the one value without it stands alone.
    word: [&'static str; 2],
    quantity: Quantity,
    /// None where the value is needed.
    default: Option<f32>,
    /// A word for a value that is no quantity.
    other: Option<(&'static str, f32)>,
}

/// No word.
const ALONE: [&str; 2] = [""; 2];
/// A load that the board weighs itself is no number.
const AUTO: f32 = f32::NAN;
/// The load of a homing or a move.
pub const LOAD: Field = Field {
    key: "load_n",
    word: ["load", "auto|L"],
    quantity: Quantity::Load,
    default: Some(AUTO),
    other: Some(("auto", AUTO)),
};
/// The speed of a move; `max` is as fast as the motor allows.
pub const SPEED: Field = Field {
    key: "speed_m_per_s",
    word: ["speed", "V|max"],
    quantity: Quantity::Speed,
    default: Some(2e-3),
    other: Some(("max", f32::INFINITY)),
};

const fn field(key: &'static str, word: [&'static str; 2], quantity: Quantity, default: Option<f32>) -> Field {
    Field { key, word, quantity, default, other: None }
}

/// A kind of request.
struct Form {
    /// Its name in a script.
    script: &'static str,
    /// Its name in an object; none where a client of `serve` has no such order.
    object: Option<&'static str>,
    fields: &'static [Field],
    /// The request with these values.
    request: fn(&[f32]) -> Request,
}

const fn form(
    script: &'static str,
    object: Option<&'static str>,
    fields: &'static [Field],
    request: fn(&[f32]) -> Request,
) -> Form {
    Form { script, object, fields, request }
}

const FORMS: [Form; 9] = [
    form("home", Some("home"), &[LOAD], |v| Request::Home { load: load(v[0]) }),
    form("move", Some("move"), &[field("to_m", ALONE, Quantity::Length, None), SPEED, LOAD], |v| Request::Move {
        target_m: v[0],
        speed_m_per_s: v[1],
        load: load(v[2]),
    }),
    form(
        "set-point",
        Some("track"),
        &[
            field("position_m", ALONE, Quantity::Length, None),
            field("speed_m_per_s", ["speed", "V"], Quantity::Speed, Some(0.0)),
            field("for_s", ["for", "S"], Quantity::Time, Some(HOLDS_FOR_S)),
        ],
        |v| Request::Track { position_m: v[0], speed_m_per_s: v[1], for_s: v[2] },
    ),
    form("jog", Some("jog"), &[field("speed_rad_per_s", ALONE, Quantity::AngularSpeed, None)], |v| Request::Jog {
        twist_speed_rad_per_s: v[0],
    }),
    form("stop", Some("stop"), &[], |_| Request::Stop),
    form("hold", Some("hold"), &[], |_| Request::Stop),
    form("clear", Some("clear"), &[], |_| Request::Clear),
    form("check-direction", Some("check-direction"), &[], |_| Request::CheckDirection),
    // What a client of `serve` calls status is the server's.
    form("status", None, &[], |_| Request::Status),
];

fn load(load_n: f32) -> LoadChoice {
    if load_n.is_nan() { LoadChoice::Auto } else { LoadChoice::Known(load_n) }
}

/// The name of a request in a script, and its values.
fn values(request: &Request) -> Option<(&'static str, Vec<f32>)> {
    let load_n = |load: LoadChoice| if let LoadChoice::Known(load_n) = load { load_n } else { AUTO };
    Some(match *request {
        Request::Home { load: LoadChoice::Auto } => ("home", vec![]),
        Request::Home { load } => ("home", vec![load_n(load)]),
        Request::Move { target_m, speed_m_per_s, load } => ("move", vec![target_m, speed_m_per_s, load_n(load)]),
        Request::Track { position_m, speed_m_per_s, for_s } => ("set-point", vec![position_m, speed_m_per_s, for_s]),
        Request::Jog { twist_speed_rad_per_s } => ("jog", vec![twist_speed_rad_per_s]),
        Request::Stop => ("stop", vec![]),
        Request::Clear => ("clear", vec![]),
        Request::CheckDirection => ("check-direction", vec![]),
        _ => return None,
    })
}

impl Field {
    /// Reads a value as an operator types it.
    ///
    /// # Errors
    /// If it is none, naming the parameter.
    pub fn parse(&self, parameter: &str, text: &str) -> Result<f64, String> {
        match self.other {
            Some((word, value)) if text.trim() == word => Ok(value.into()),
            Some((word, _)) => units::parse(parameter, self.quantity, text).map_err(|e| format!("{e}; or `{word}`")),
            None => units::parse(parameter, self.quantity, text).map_err(|e| e.to_string()),
        }
    }

    /// As it stands in a script.
    fn text(&self, value: f32) -> String {
        let other = self.other.filter(|(_, other)| other.total_cmp(&value).is_eq());
        let value = other.map_or_else(|| value.to_string(), |(word, _)| word.into());
        if self.word[0].is_empty() { value } else { format!("{}={value}", self.word[0]) }
    }

    fn number(&self, value: &Value) -> Result<f32, String> {
        let name = self.key;
        let number = value.as_f64().ok_or_else(|| format!("{name} is {value} and must be a number in SI units"))?;
        let single = number as f32;
        if single.is_finite() { Ok(single) } else { Err(format!("{name} is {value}: too large")) }
    }
}

/// `auto` or a load.
///
/// # Errors
/// If it is neither, in words.
pub fn load_choice(text: &str) -> Result<LoadChoice, String> {
    LOAD.parse("load", text).map(|load_n| load(load_n as f32))
}

/// The request of a line of a log.
///
/// # Errors
/// If it is none, in words.
pub fn from_text(text: &str) -> Result<Request, String> {
    from_words(&text.split_whitespace().collect::<Vec<_>>())
        .unwrap_or_else(|| Err(format!("`{text}` is not a request")))
}

/// The request that the words of a script name; none if they name none.
///
/// # Errors
/// What is wrong with its values, in words.
pub fn from_words(words: &[&str]) -> Option<Result<Request, String>> {
    if let ["config", "set", name, value] = words {
        return Some(setting(name, value));
    }
    let (name, words) = words.split_first()?;
    let form = FORMS.iter().find(|form| form.script == *name)?;
    let values = match given(form, words) {
        Ok(values) => values,
        Err(wrong) => return Some(Err(wrong)),
    };
    let values: Option<Vec<f32>> =
        values.into_iter().zip(form.fields).map(|(value, field)| value.or(field.default)).collect();
    Some(Ok((form.request)(&values?)))
}

fn given(Form { script: name, fields, .. }: &Form, words: &[&str]) -> Result<Vec<Option<f32>>, String> {
    let mut values = vec![None; fields.len()];
    for word in words {
        let (before, text) = word.split_once('=').unwrap_or(("", word));
        match fields.iter().position(|field| field.word[0] == before).map(|place| (&fields[place], &mut values[place]))
        {
            Some((field, value @ None)) => {
                *value = Some(field.parse(if before.is_empty() { name } else { before }, text)? as f32)
            }
            Some(_) if !before.is_empty() => return Err(format!("`{word}`: {before} is given twice")),
            _ => {
                let options = fields.iter().map(|field| field.word).filter(|word| *word != ALONE);
                let options: Vec<String> = options.map(|word| word.join("=")).collect();
                return Err(format!("{name} has no option `{word}`; options: {}", options.join(", ")));
            }
        }
    }
    Ok(values)
}

fn setting(name: &str, value: &str) -> Result<Request, String> {
    let setting = board_settings::named(name)?;
    let value = board_settings::value(setting, value).map_err(|e| e.to_string())?;
    Ok(Request::SetSetting { setting, value })
}

/// A request as a line of a script; none for requests that a script does not have.
pub fn text(request: &Request) -> Option<String> {
    if let Request::SetSetting { setting, value } = request {
        return Some(format!("config set {setting} {value}"));
    }
    let (name, values) = values(request)?;
    let form = FORMS.iter().find(|form| form.script == name)?;
    let words = form.fields.iter().zip(values).map(|(field, value)| field.text(value));
    Some(std::iter::once(name.to_owned()).chain(words).collect::<Vec<_>>().join(" "))
}

/// The request of an object of this name. The fields that it has taken are gone.
///
/// # Errors
/// In words, naming the field.
pub fn from_object(name: &str, object: &mut Map<String, Value>) -> Result<Request, String> {
    let form = FORMS.iter().find(|form| form.object == Some(name));
    let form = form.ok_or_else(|| format!("there is no order `{name}`; there are {}", names()))?;
    let value = |field: &Field| match object.remove(field.key) {
        Some(value) => field.number(&value),
        None => field.default.ok_or_else(|| format!("there is no field `{}`, which this order needs", field.key)),
    };
    let values: Vec<f32> = form.fields.iter().map(value).collect::<Result<_, _>>()?;
    Ok((form.request)(&values))
}

/// The names that objects have.
pub fn names() -> String {
    FORMS.iter().filter_map(|form| form.object).chain(["status"]).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_come_back_from_their_own_words() {
        for words in [
            "home",
            "home load=4.903325",
            "stop",
            "clear",
            "check-direction",
            "jog -1.309",
            "move 0.0123456 speed=0.0007 load=4.903325",
            "move 0.0123456 speed=max load=auto",
            "set-point 0.0123456 speed=-0.0007 for=0.2",
            "config set lvdt-gain 1.01",
        ] {
            assert_eq!(from_text(words).map(|request| text(&request)), Ok(Some(words.into())));
        }
        assert_eq!((from_text("hold"), from_text("home load=auto")), (Ok(Request::Stop), Ok(Request::HOME)));
        assert!(from_text("plant load=1").is_err() && text(&Request::Heartbeat).is_none());
    }
}
