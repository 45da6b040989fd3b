//! What a line of a client means. Each order of the board is one line of the table `ORDERS`.

use super::Refused;
use super::lines::LONGEST;
use crate::course::HOLDS_FOR_S;
use crate::script::DEFAULT_SPEED_M_PER_S;
use rig_link::{LoadChoice, Request};
use serde_json::{Map, Value};

/// The request of an order, from its fields.
type Build = fn(&mut Fields) -> Result<Request, String>;

/// The orders by their names in `do`.
const ORDERS: [(&str, Build); 8] = [
    ("home", |f| Ok(Request::Home { load: f.load()? })),
    ("move", |f| {
        let (target_m, speed) = (f.number("to_m")?, f.number_or("speed_m_per_s", DEFAULT_SPEED_M_PER_S as f32)?);
        Ok(Request::Move { target_m, speed_m_per_s: speed, load: f.load()? })
    }),
    ("track", |f| {
        let (position_m, speed_m_per_s) = (f.number("position_m")?, f.number_or("speed_m_per_s", 0.0)?);
        Ok(Request::Track { position_m, speed_m_per_s, for_s: f.number_or("for_s", HOLDS_FOR_S)? })
    }),
    ("jog", |f| Ok(Request::Jog { twist_speed_rad_per_s: f.number("speed_rad_per_s")? })),
    ("stop", |_| Ok(Request::Stop)),
    ("hold", |_| Ok(Request::Stop)),
    ("clear", |_| Ok(Request::Clear)),
    ("check-direction", |_| Ok(Request::CheckDirection)),
];

/// What a client wants.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// An order to the board.
    Order(Box<Request>),
    /// The state of board and server.
    Status,
    /// To be the writer no longer.
    Release,
}

/// A line of a client: the `id` by which it knows the answer, and what it wants.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// A number or a text.
    pub id: Option<Value>,
    /// What it wants, or why that is not clear.
    pub command: Result<Command, Refused>,
}

impl Line {
    /// Of a line that was too long to be read.
    pub fn too_long() -> Self {
        Self { id: None, command: Err(Refused::new("too-long", format!("a line can have {LONGEST} bytes"))) }
    }

    /// Reads a line.
    pub fn read(bytes: &[u8]) -> Self {
        let bad = |message: String| Refused::new("bad-request", message);
        let mut fields = match serde_json::from_slice::<Value>(bytes) {
            Ok(Value::Object(fields)) => Fields(fields),
            Ok(_) => return Self { id: None, command: Err(bad("not a JSON object".into())) },
            Err(e) => return Self { id: None, command: Err(bad(format!("not JSON: {e}"))) },
        };
        let id = match fields.0.remove("id") {
            Some(Value::Object(_) | Value::Array(_)) => {
                return Self { id: None, command: Err(bad("id must be a number or a text".into())) };
            }
            id => id,
        };
        Self { id, command: command(&mut fields).map_err(bad) }
    }
}

fn command(fields: &mut Fields) -> Result<Command, String> {
    let command = match (fields.0.remove("do"), fields.0.remove("release")) {
        (Some(Value::String(name)), None) if name == "status" => Command::Status,
        (Some(Value::String(name)), None) => {
            let order = ORDERS.iter().find(|(known, _)| *known == name);
            let (_, build) = order.ok_or_else(|| format!("there is no order `{name}`; there are {}", names()))?;
            Command::Order(Box::new(build(fields)?))
        }
        (None, Some(Value::Bool(true))) => Command::Release,
        (None, Some(_)) => return Err("release can only be true".into()),
        (Some(_), None) => return Err(format!("do must be a text: one of {}", names())),
        (None, None) => return Err("there is neither `do` nor `release`".into()),
        (Some(_), Some(_)) => return Err("there are both `do` and `release`".into()),
    };
    match fields.0.keys().next() {
        None => Ok(command),
        Some(unknown) => Err(format!("there is no field `{unknown}` in this order")),
    }
}

fn names() -> String {
    ORDERS.iter().map(|(name, _)| *name).chain(["status"]).collect::<Vec<_>>().join(", ")
}

/// The fields of an order. Those that it has taken are gone, so that an unknown one is found.
struct Fields(Map<String, Value>);

impl Fields {
    fn optional(&mut self, name: &str) -> Result<Option<f32>, String> {
        let Some(value) = self.0.remove(name) else { return Ok(None) };
        let number = value.as_f64().ok_or_else(|| format!("{name} is {value} and must be a number in SI units"))?;
        let single = number as f32;
        if single.is_finite() { Ok(Some(single)) } else { Err(format!("{name} is {value}: too large")) }
    }

    fn number(&mut self, name: &str) -> Result<f32, String> {
        self.optional(name)?.ok_or_else(|| format!("there is no field `{name}`, which this order needs"))
    }

    fn number_or(&mut self, name: &str, default: f32) -> Result<f32, String> {
        Ok(self.optional(name)?.unwrap_or(default))
    }

    /// The load as the operator knows it; without the field the board weighs it.
    fn load(&mut self) -> Result<LoadChoice, String> {
        Ok(self.optional("load_n")?.map_or(LoadChoice::Auto, LoadChoice::Known))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn order(request: Request) -> Command {
        Command::Order(Box::new(request))
    }

    #[test]
    fn orders_and_their_fields() {
        let speed_m_per_s = DEFAULT_SPEED_M_PER_S as f32;
        for (text, command) in [
            ("{\"do\":\"home\"}", order(Request::HOME)),
            ("{\"do\":\"home\",\"load_n\":5}", order(Request::Home { load: LoadChoice::Known(5.0) })),
            (
                "{\"do\":\"move\",\"to_m\":0.012}",
                order(Request::Move { target_m: 0.012, speed_m_per_s, load: LoadChoice::Auto }),
            ),
            (
                "{\"load_n\":4.9,\"to_m\":1e-3,\"speed_m_per_s\":0.001,\"do\":\"move\"}",
                order(Request::Move { target_m: 1e-3, speed_m_per_s: 1e-3, load: LoadChoice::Known(4.9) }),
            ),
            (
                "{\"do\":\"track\",\"position_m\":0.01,\"speed_m_per_s\":-0.002}",
                order(Request::Track { position_m: 0.01, speed_m_per_s: -0.002, for_s: HOLDS_FOR_S }),
            ),
            ("{\"do\":\"jog\",\"speed_rad_per_s\":-2}\r", order(Request::Jog { twist_speed_rad_per_s: -2.0 })),
            ("{\"do\":\"stop\"}", order(Request::Stop)),
            ("{\"do\":\"hold\"}", order(Request::Stop)),
            ("{\"do\":\"clear\"}", order(Request::Clear)),
            ("{\"do\":\"status\"}", Command::Status),
            ("{\"release\":true}", Command::Release),
        ] {
            assert_eq!(Line::read(text.as_bytes()), Line { id: None, command: Ok(command) }, "{text}");
        }
        for id in [json!(7), json!("a"), json!(-0.5)] {
            let text = json!({"id": id, "do": "stop"}).to_string();
            assert_eq!(Line::read(text.as_bytes()).id, Some(id));
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, named) in [
            ("", "not JSON"),
            ("move 5mm", "not JSON"),
            ("\u{ff}", "not JSON"),
            ("[1]", "not a JSON object"),
            ("5", "not a JSON object"),
            ("{}", "neither `do` nor `release`"),
            (
                "{\"do\":\"mve\"}",
                "no order `mve`; there are home, move, track, jog, stop, hold, clear, check-direction, status",
            ),
            ("{\"do\":5}", "do must be a text"),
            ("{\"do\":\"move\"}", "no field `to_m`"),
            ("{\"do\":\"move\",\"to_m\":\"0.012\"}", "to_m is \"0.012\" and must be a number"),
            ("{\"do\":\"move\",\"to_m\":NaN}", "not JSON"),
            ("{\"do\":\"move\",\"to_m\":null}", "to_m is null"),
            ("{\"do\":\"move\",\"to_m\":1e300}", "too large"),
            ("{\"do\":\"move\",\"to_m\":0.01,\"sped\":1}", "no field `sped`"),
            ("{\"do\":\"stop\",\"to_m\":0.01}", "no field `to_m` in this order"),
            ("{\"do\":\"stop\",\"release\":true}", "both"),
            ("{\"release\":false}", "only be true"),
            ("{\"id\":{},\"do\":\"stop\"}", "id must be"),
        ] {
            let refused = Line::read(text.as_bytes()).command.expect_err(text);
            assert!(refused.kind == "bad-request" && refused.message.contains(named), "{text}: {refused:?}");
        }
        // Too large for any number: not JSON, or no number, as serde_json is built.
        assert!(Line::read(b"{\"do\":\"move\",\"to_m\":1e999}").command.is_err());
        // Deeply nested, and not UTF-8.
        let deep = format!("{{\"do\":{}", "[".repeat(4000));
        for bytes in [deep.as_bytes(), b"{\"do\":\"\xff\"}"] {
            assert!(Line::read(bytes).command.is_err_and(|refused| refused.message.contains("not JSON")));
        }
        let line = Line::read(b"{\"id\":3,\"do\":\"move\",\"to_m\":true}");
        assert!(line.id == Some(json!(3)) && line.command.is_err(), "an error has its id");
    }
}
