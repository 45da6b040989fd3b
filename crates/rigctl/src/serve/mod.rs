//! A rig for several programs at once: JSON lines on a Unix socket, one writer, many readers. `crates/rigctl/serve.md`
//! states the protocol.
//!
//! - [`server`]: the loop between the board and the clients.
//! - [`order`]: what a line of a client means; [`flights`]: orders that were given and have not ended.
//! - [`client`]: one connection with its two threads: lines of bounded length, and lines that wait for a slow reader, or are lost.
//! - [`socket`]: the socket file and who may connect.

pub mod client;
pub mod flights;
pub mod order;
pub mod server;
pub mod socket;

pub use server::serve;
pub use socket::Socket;

use crate::failure::Refused;
use serde_json::{Map, Value, json};

/// Name and version of the protocol, in the greeting of every client.
pub const PROTOCOL: &str = "tsa-serve 1";

/// The answer to a client's line, with the `id` that it gave.
pub fn answer(id: Option<&Value>, result: Result<Value, Refused>) -> String {
    let mut object = Map::new();
    if let Some(id) = id {
        object.insert("id".into(), id.clone());
    }
    match result {
        Ok(done) => object.insert("done".into(), done),
        Err(refused) => object.insert("error".into(), json!(refused)),
    };
    Value::Object(object).to_string()
}

/// An event for all clients.
pub fn event(t_s: f64, kind: &str, message: &str) -> String {
    json!({"event": {"t_s": t_s, "kind": kind, "message": message}}).to_string()
}
