//! The door that the environment variable `DOOR` names ([`DOORS`]).
#![no_main]

#[path = "../doors/mod.rs"]
mod doors;

use doors::{DOORS, Door};
use std::sync::LazyLock;

static DOOR: LazyLock<Door> = LazyLock::new(|| {
    let name = std::env::var("DOOR").unwrap_or_default();
    let found = DOORS.iter().find(|(known, ..)| *known == name);
    found.unwrap_or_else(|| panic!("DOOR={name} is none of {:?}", DOORS.iter().map(|(name, ..)| name))).1
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| DOOR(data));
