//! What a line of a client means.

use super::client::LONGEST;
use crate::failure::Refused;
use crate::request;
use rig_link::Request;
use serde_json::{Map, Value};

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
            Ok(Value::Object(fields)) => fields,
            Ok(_) => return Self { id: None, command: Err(bad("not a JSON object".into())) },
            Err(e) => return Self { id: None, command: Err(bad(format!("not JSON: {e}"))) },
        };
        let id = match fields.remove("id") {
            Some(Value::Object(_) | Value::Array(_)) => {
                return Self { id: None, command: Err(bad("id must be a number or a text".into())) };
            }
            id => id,
        };
        Self { id, command: command(&mut fields).map_err(bad) }
    }
}

fn command(fields: &mut Map<String, Value>) -> Result<Command, String> {
    let command = match (fields.remove("do"), fields.remove("release")) {
        (Some(Value::String(name)), None) if name == "status" => Command::Status,
        (Some(Value::String(name)), None) => Command::Order(Box::new(request::from_object(&name, fields)?)),
        (None, Some(Value::Bool(true))) => Command::Release,
        (None, Some(_)) => return Err("release can only be true".into()),
        (Some(_), None) => return Err(format!("do must be a text: one of {}", request::names())),
        (None, None) => return Err("there is neither `do` nor `release`".into()),
        (Some(_), Some(_)) => return Err("there are both `do` and `release`".into()),
    };
    match fields.keys().next() {
        None => Ok(command),
        Some(unknown) => Err(format!("there is no field `{unknown}` in this order")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::HOLDS_FOR_S;
    use rig_link::LoadChoice;
    use serde_json::json;

    fn order(request: Request) -> Command {
        Command::Order(Box::new(request))
    }

    #[test]
    fn orders_and_their_fields() {
        let speed_m_per_s = 2e-3;
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
