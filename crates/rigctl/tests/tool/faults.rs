//! Every fault that a script can cause, on the real firmware on the emulated board.

use crate::common::{error_of, file, lines, rigctl, text};
use serde_json::Value;

/// Each time that fault or emergency stop began: when (s), and which.
fn stops(rows: &[Value]) -> Vec<(f64, String)> {
    let mut found: Vec<(f64, String)> = Vec::new();
    let mut last = String::new();
    for row in rows {
        let name = match (row["fault"].as_str(), row["state"].as_str()) {
            (Some(fault), _) => fault,
            (None, Some("estop")) => "estop",
            _ => "",
        };
        if name != last {
            last = name.to_string();
            if !last.is_empty() {
                found.push((row["t_s"].as_f64().expect("a time"), last.clone()));
            }
        }
    }
    found
}

/// Plays a scenario; its telemetry and what was refused.
fn play(name: &str) -> (Vec<Value>, String) {
    let output = rigctl(&["sim", "--script", &format!("scenarios/{name}.script"), "--json", "--seed", "4"]);
    let said = error_of(&output);
    // A script is done if nothing in it was refused; the last line counts what was.
    let (count, last) = (said.matches("refused: ").count(), said.lines().last().unwrap_or_default().to_owned());
    let expected = if count == 0 { 0 } else { 1 };
    assert_eq!(output.status.code(), Some(expected), "{said}");
    assert!(count == 0 || last.starts_with(&format!("error: {count} command")), "{count} refused: {said}");
    let mut rows = lines(&output);
    rows.pop();
    (rows, said)
}

fn compare(found: &[(f64, String)], wanted: &[(f64, f64, &str)]) {
    for (t_s, name) in found {
        println!("{t_s:7.2} s {name}");
    }
    let names: Vec<&str> = found.iter().map(|(_, name)| name.as_str()).collect();
    let expected: Vec<&str> = wanted.iter().map(|(.., name)| *name).collect();
    assert_eq!(names, expected, "{found:?}");
    for ((t_s, name), (from_s, within_s, _)) in found.iter().zip(wanted) {
        assert!((*from_s..from_s + within_s).contains(t_s), "{name} at {t_s} s, caused at {from_s} s");
    }
}

fn state_at(rows: &[Value], t_s: f64) -> &str {
    let row = rows.iter().find(|r| r["t_s"].as_f64().is_some_and(|t| t >= t_s)).expect("a row");
    row["state"].as_str().expect("a state")
}

#[test]
fn wrong_wires_are_found_at_the_first_motion() {
    let (rows, _) = play("faults-wiring");
    compare(
        &stops(&rows),
        &[
            (3.0, 0.8, "motor-direction"),
            (8.2, 0.8, "motor-still"),
            (13.2, 0.8, "drive-encoder"),
            (18.2, 0.8, "encoder-direction"),
            (31.0, 0.3, "motor-still"),
            (36.0, 3.5, "clock-source"),
        ],
    );
    assert_eq!((state_at(&rows, 27.5), state_at(&rows, 46.5)), ("unhomed", "unhomed"));
}

#[test]
fn a_stop_that_is_pressed_and_released_while_a_setting_is_written_is_seen() {
    let script = file("stop-while-writing.script");
    let lines = "3 config set speed-max 3mm/s\n3.02 fault estop\n3.05 fault estop off\n4 end\n";
    std::fs::write(&script, lines).expect("written");
    let played = rigctl(&["sim", "--script", text(&script), "--json"]);
    let states: Vec<Value> = self::lines(&played).into_iter().map(|row| row["state"].clone()).collect();
    assert!(states.contains(&"estop".into()), "{}", error_of(&played));
}

#[test]
fn faults_that_keep_the_position_fire_and_clear_and_near_misses_are_quiet() {
    let (rows, refused) = play("faults-homed");
    compare(
        &stops(&rows),
        &[
            // The last heartbeat may be a whole period old when the host falls silent.
            (36.6, 0.5, "host-silent"),
            (39.6, 0.15, "tick-late"),
            (42.6, 0.05, "limit-switch"),
            (45.6, 0.15, "lvdt-open"),
            (48.6, 0.15, "lvdt-short"),
            (51.6, 0.2, "lvdt-noisy"),
            (54.6, 0.5, "lvdt-frozen"),
            (57.6, 0.3, "supply"),
            (60.8, 2.0, "load-range"),
        ],
    );
    assert_eq!(refused.matches("refused: ").count(), 1, "{refused}");
    assert!(refused.contains("supply cannot be cleared"), "{refused}");
    // Through all of it the position was never lost: the last move ends where it should.
    let last = rows.last().expect("rows");
    assert_eq!(last["state"], "holding");
    let error_m = last["true_position_m"].as_f64().expect("homed") - 0.002;
    assert!(error_m.abs() < 50e-6, "{error_m} m");
}

#[test]
fn faults_that_lose_the_position_restart_the_drive_and_wait() {
    let (rows, refused) = play("faults-restart");
    compare(
        &stops(&rows),
        &[
            (6.0, 0.5, "encoder-stuck"),
            (14.5, 0.2, "encoder-jump"),
            (23.0, 0.2, "drive-stall"),
            (31.5, 0.2, "drive-silent"),
            // The drive has let go of strings that were jogged.
            (31.5, 1.0, "not-held"),
            (40.0, 0.2, "drive-silent"),
            (48.5, 0.1, "can-bus-off"),
            (57.0, 0.05, "estop"),
            (66.5, 0.1, "panicked"),
            (76.0, 1.0, "watchdog-reset"),
            (93.5, 2.0, "following-error"),
            (93.5, 3.0, "not-held"),
            (106.5, 1.0, "string-break"),
        ],
    );
    for (line, reason) in [
        ("can-bus-off cannot be cleared", 1),
        ("emergency stop is pressed", 1),
        ("fault panicked is latched", 1),
        ("fault watchdog-reset is latched", 1),
    ] {
        assert_eq!(refused.matches(line).count(), reason, "{line}: {refused}");
    }
    assert_eq!(refused.matches("refused: ").count(), 4, "{refused}");
    // Each `clear` leads to rest, and to nothing else.
    for t_s in [11.4, 19.9, 28.4, 36.9, 45.4, 53.9, 63.4, 72.9, 82.4, 89.9, 103.4] {
        assert_eq!(state_at(&rows, t_s), "unhomed", "{t_s} s");
    }
}

#[test]
fn starts_without_drive_or_sensor_and_resets_wait_and_late_ones_do_not() {
    let (rows, refused) = play("faults-start");
    compare(
        &stops(&rows),
        &[
            // Boot, then ten online checks without an echo; the same again after `clear`.
            (3.0, 1.0, "drive-start-up"),
            (8.5, 1.0, "drive-start-up"),
            // The drive's start-up, then 3 s.
            (29.5, 1.0, "lvdt-open"),
            (47.5, 0.1, "unexpected-reset"),
            (56.0, 0.5, "encoder-disagrees"),
            (64.5, 0.2, "lvdt-stalled"),
        ],
    );
    assert_eq!(refused.matches("refused: ").count(), 1, "{refused}");
    assert!(refused.contains("fault unexpected-reset is latched"), "{refused}");
    // Each `clear`, and each start that was only late, leads to rest.
    for t_s in [13.9, 25.4, 37.4, 44.4, 52.9, 61.4, 66.9] {
        assert_eq!(state_at(&rows, t_s), "unhomed", "{t_s} s");
    }
    assert_eq!(rows.last().expect("rows")["state"], "moving");
}

#[test]
fn strings_and_load_fire_and_limits_are_told_apart_from_faults() {
    let (rows, refused) = play("faults-strings");
    compare(
        &stops(&rows),
        &[(51.0, 4.0, "following-error"), (103.0, 12.0, "model-residual"), (118.0, 2.0, "lvdt-jump")],
    );
    // Outside the range that is left at the heavy load.
    assert!(!refused.contains("latched"), "{refused}");
    let between = |from_s: f64, to_s: f64| {
        rows.iter().filter(move |r| r["t_s"].as_f64().is_some_and(|t| (from_s..to_s).contains(&t)))
    };
    for (key, limit, from_s, to_s) in [
        ("limit", "motor-speed", 58.0, 61.0),
        ("limit", "travel", 80.0, 86.0),
        ("doubts", "load-range", 92.0, 94.0),
        ("doubts", "load-unknown", 92.0, 98.0),
    ] {
        let told = |r: &&Value| r[key].as_str().is_some_and(|names| names.split(' ').any(|name| name == limit));
        let seen: Vec<_> = between(from_s, to_s).filter(told).collect();
        assert!(seen.len() >= 5, "{limit}: {} rows", seen.len());
        assert!(seen.iter().all(|r| r["fault"].is_null()), "{limit} with a fault");
    }
    // They clip and go.
    assert!(between(97.0, 98.0).all(|r| r["limit"].is_null()), "a limit that stays");
    // The fastest that the motor may turn, from the scene.
    let fastest = between(58.0, 61.0).filter_map(|r| r["drive_speed_rad_per_s"].as_f64()).fold(0.0, f64::max);
    assert!((700.0..=1047.0).contains(&fastest), "{fastest} rad/s");
    assert_eq!(state_at(&rows, 116.9), "unhomed");
}

#[test]
fn status_tells_of_losses_and_of_the_telemetrys_rate() {
    let output = rigctl(&["status", "--json"]);
    assert!(output.status.success(), "{}", error_of(&output));
    let status = &lines(&output)[0];
    let number = |key: &str| status[key].as_f64().unwrap_or_else(|| panic!("{key} in {status}"));
    assert!((99.0..=101.0).contains(&number("telemetry_hz")), "{status}");
    for key in ["lost_frames", "unsent", "late_ticks", "link_errors", "foreign_frames"] {
        assert_eq!(number(key), 0.0, "{key} in {status}");
    }
    assert!(number("longest_tick_s") < 0.002, "{status}");
    assert!(status["last_panic"].is_null(), "{status}");
}
