//! The door that the environment variable `DOOR` names ([`DOORS`]).
#![no_main]

#[path = "../doors/mod.rs"]
mod doors;

use doors::{DOORS, Door};
use std::sync::LazyLock;

static DOOR: LazyLock<Door> = LazyLock::new(|| {
    let wanted = std::env::var("DOOR").unwrap_or_default();
    let names: Vec<&str> = DOORS.iter().map(|(name, ..)| *name).collect();
    let found = DOORS.iter().find(|(name, ..)| *name == wanted);
    found.unwrap_or_else(|| panic!("DOOR={wanted} is none of {}", names.join(", "))).1
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| (*DOOR)(data));
