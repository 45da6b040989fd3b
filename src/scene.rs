//! The table and the rig's constants, written by the build script from the scene file.

include!(concat!(env!("OUT_DIR"), "/scene.rs"));
