//! `rigctl selftest` on the emulated board.

use crate::common::{error_of, lines, rigctl, root};
use std::process::Command;

/// The image, made first if it is not there.
fn image() {
    if !root().join("target/firmware/tsa-selftest.elf").exists() {
        let status = Command::new("cargo").args(["xtask", "selftest", "--emulated"]).current_dir(root()).status();
        assert!(status.is_ok_and(|s| s.success()), "`cargo xtask selftest --emulated` failed");
    }
}

#[test]
fn every_check_is_a_row_and_all_are_ok() {
    image();
    let done = rigctl(&["--json", "selftest"]);
    assert!(done.status.success(), "{}", error_of(&done));
    let rows = lines(&done);
    assert_eq!(rows.len(), 17);
    assert!(rows.iter().all(|row| row["verdict"] == "ok" && row["seen"] != ""), "{rows:?}");
    let text = rigctl(&["selftest"]);
    assert!(String::from_utf8_lossy(&text.stdout).contains("selftest ended: all 17 checks ok"));
}

#[test]
fn an_image_that_is_no_self_test_is_no_success() {
    image();
    let firmware = root().join("target/firmware/tsa-firmware.elf");
    let done = rigctl(&["--firmware", &firmware.to_string_lossy(), "selftest"]);
    assert_eq!(done.status.code(), Some(1));
    assert!(error_of(&done).contains("self-test"), "{}", error_of(&done));
}
