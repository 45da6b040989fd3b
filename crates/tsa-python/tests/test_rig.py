"""The client, on the emulated board."""

import os
import signal
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
# Where `cargo xtask python` has built the emulator.
PROGRAMS = os.environ.get("TSA_PROGRAMS")
SCENE = ROOT / "scenes" / "default.toml"


def emulated() -> tsa_rig.Rig:
    return tsa_rig.Rig("sim", scene=SCENE, rig="nominal", seed=1, plant={"load": "0.5kg"}, programs=PROGRAMS)


def test_it_homes_moves_and_tells() -> None:
    with emulated() as rig:
        homed = rig.home()
        assert homed["load_n"] == pytest.approx(4.9, abs=3.0 * homed["load_error_n"])
        moved = rig.move(0.008, speed=0.002)
        assert abs(moved["error_m"]) < 1e-4
        told = rig.telemetry()
        assert set(told) >= {"t_s", "state", "position_m", "load_n", "load_error_n", "tr_rad_per_m", "true_position_m"}
        assert told["position_m"][-1] == pytest.approx(0.008, abs=2e-4) and np.isnan(told["position_m"][0])
        assert np.all(np.diff(told["t_s"]) > 0.0) and told["state"][-1] in ("moving", "holding")
        assert np.all(told["fault"] == ""), "a word also where there is none"
    with pytest.raises(RuntimeError, match="closed"):
        rig.home()
    assert rig.telemetry()["t_s"].size > 0


def test_a_course_is_followed_and_what_is_none_is_named() -> None:
    times = np.linspace(0.0, 2.0, 101)
    with emulated() as rig:
        rig.home()
        followed = rig.track(times, 0.006 + 0.001 * np.sin(np.pi * times / 2.0) ** 2)
        assert followed["following_rms_m"] < 3e-4 and abs(followed["error_m"]) < 2e-4
        assert followed["duration_s"] == pytest.approx(2.0)
        with pytest.raises(ValueError, match="101 times, 2 positions"):
            rig.track(times, [0.006, 0.007])
        with pytest.raises(ValueError, match="point 1"):
            rig.track([0.0, 1.0], [0.006, np.nan])
        with pytest.raises(ValueError, match="lists"):
            rig.track(0.0, 0.006)
        before = rig.latest()
        for moments, positions, why in [
            ([0.0, 5.0, 60.0], [0.002, 0.002, 0.06], r"point 2: target is 0\.06 m, allowed are"),
            ([0.0, 0.1, 5.0], [0.002, 0.008, 0.008], "point 0: its acceleration is"),
        ]:
            with pytest.raises(tsa_rig.OperationError, match=why) as refused:
                rig.track(moments, positions)
            assert refused.value.kind == "refused"
        after = rig.latest()
        assert after["state"] == before["state"] == "holding"
        assert after["true_position_m"] == pytest.approx(before["true_position_m"], abs=2e-4), "it has not moved"


def test_refusals_are_errors_with_the_boards_words() -> None:
    with emulated() as rig:
        with pytest.raises(RuntimeError, match="home"):
            rig.move(0.008)
        with pytest.raises(ValueError, match="no key `weight`"):
            rig.set_plant(weight="0.5kg")
    with pytest.raises(ValueError, match="load"):
        tsa_rig.Rig("sim", scene=SCENE, plant={"load": "heavy"}, programs=PROGRAMS)
    with pytest.raises(RuntimeError, match="no-such-device"):
        tsa_rig.Rig("/dev/no-such-device", scene=SCENE)
    with pytest.raises(FileNotFoundError, match="rig-emulator"):
        tsa_rig.Rig("sim", scene=SCENE, programs="/nowhere")


def test_an_exception_stops_the_motion() -> None:
    with pytest.raises(KeyError):
        with emulated() as rig:
            raise KeyError("mine")
    with pytest.raises(RuntimeError, match="closed"):
        rig.wait(0.1)


def test_ctrl_c_stops_the_board_and_python_goes_on() -> None:
    # A shell starts programs in the background with this signal ignored, and Python then leaves it so.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with emulated() as rig:
        rig.home()
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            for target_m in [0.01, 0.002] * 20:
                rig.move(target_m, speed=0.001)
        rig.wait(2.0)
        told = rig.telemetry()
        assert told["state"][-1] == "holding" and np.ptp(told["position_m"][-50:]) < 1e-4
        rig.move(0.004)


def test_a_move_goes_on_while_the_program_does_other_things() -> None:
    with emulated() as rig:
        rig.home()
        motion = rig.move(0.008, wait=False)
        assert not motion.done
        rows = list(rig.rows(0.5))
        assert len(rows) == 50 and rows[-1]["position_m"] > rows[0]["position_m"] and rows[-1]["state"] == "moving"
        with pytest.raises(tsa_rig.OperationError) as late:
            motion.wait(timeout=0.0)
        assert late.value.kind == "timeout" and not motion.done
        moved = motion.wait()
        assert motion.done and abs(moved["error_m"]) < 1e-4 and motion.wait() == moved
        assert rig.latest()["state"] in ("moving", "holding") and moved["target_m"] == 0.008
        motion = rig.move(0.002, speed=0.001, wait=False)
        rig.wait(0.5)
        rig.stop()
        with pytest.raises(tsa_rig.OperationError, match="stopped") as stopped:
            motion.wait()
        assert stopped.value.kind == "stopped"
        motion = rig.move(0.5, wait=False)
        with pytest.raises(tsa_rig.OperationError, match="allowed are") as refused:
            motion.wait()
        assert refused.value.kind == "refused"
        told = rig.telemetry()
        assert np.allclose(np.diff(told["t_s"]), 0.01, atol=1e-4), "the rows of all calls, without a gap"
        # What is closed stops what moves.
        motion = rig.move(0.008, wait=False)
    with pytest.raises(tsa_rig.OperationError):
        motion.wait()


def test_settings_are_kept_backed_up_and_restored(tmp_path: Path) -> None:
    with emulated() as rig:
        assert {"lvdt-offset", "speed-max"} <= set(rig.config.get())
        assert rig.config.get("lvdt-offset")["value"] == 0.0
        assert rig.config.set("lvdt-offset", 1e-4)["before"] == 0.0
        assert rig.config.backup(tmp_path / "settings.toml")["settings"]["lvdt-offset"] == 1e-4
        assert rig.config.set("lvdt-offset", "0.2mm")["value"] == 2e-4
        assert rig.config.restore(tmp_path / "settings.toml")["changed"] == 1
        assert rig.config.get("lvdt-offset")["value"] == 1e-4
        for value, kind in ((1.0, "refused"), ("3kg", "bad-request")):
            with pytest.raises(tsa_rig.RigError, match="lvdt-offset") as error:
                rig.config.set("lvdt-offset", value)
            assert error.value.kind == kind
        with pytest.raises(tsa_rig.ArgumentError, match="speed-max"):
            rig.config.get("speed")
        with pytest.raises(FileNotFoundError):
            rig.config.restore(tmp_path / "none.toml")


def test_it_calibrates_jogs_sweeps_and_says_its_status(tmp_path: Path) -> None:
    with emulated() as rig:
        status = rig.status()
        assert status["rig"] == "nominal" and status["scene_matches"] and status["telemetry"]["state"] == "unhomed"
        read = rig.calibrate("lvdt")
        assert read["gap_m"] == pytest.approx(read["true_gap_m"], abs=1e-3)
        assert abs(rig.calibrate("lvdt", gap_m=read["true_gap_m"])["error_after_m"]) < 5e-6
        for arguments in ({"point": (0.09, 0.09)}, {"gap_m": 0.09, "points": "x.csv"}):
            with pytest.raises(tsa_rig.ArgumentError, match="point"):
                rig.calibrate("lvdt", **arguments)
        before = rig.telemetry()["true_twist_rad"][-1]
        rig.jog(1.0, 0.5)
        assert rig.latest()["true_twist_rad"] == pytest.approx(before + 0.5, abs=0.15)
        with pytest.raises(tsa_rig.ArgumentError, match="seconds"):
            rig.jog(1.0, -1.0)
        with pytest.raises(tsa_rig.OperationError, match="load_n 500 N"):
            rig.sweep(500.0, tmp_path / "sweep.csv")
        swept = rig.sweep(6.0, tmp_path / "sweep.csv", turns=1.0, speed_rad_per_s=3.0)
        assert swept["load_n"] == 6.0 and swept["contraction_m"] > 0.0 and rig.latest()["true_load_n"] == 6.0
        assert len(tsa_rig.read_log(tmp_path / "sweep.csv")["t_s"]) == swept["rows"]
        rig.move(0.004)
        zero = rig.calibrate("zero")
        assert zero["position_before_m"] == pytest.approx(0.004, abs=2e-4) and abs(zero["position_m"]) < 5e-5


def test_what_passes_is_a_log_and_a_board_is_examined(tmp_path: Path) -> None:
    with emulated() as rig:
        log = rig.record(tmp_path / "rest.csv", 0.5)
        told = tsa_rig.read_log(tmp_path / "rest.csv")
        assert log == {"rows": len(told["t_s"]), "lost_rows": 0, "lost_frames": 0}
        assert 0.49 <= told["t_s"][-1] - told["t_s"][0] <= 0.51
        # While flash is written the board sends no telemetry: rows that were lost before the log begins.
        for zero_m in (1e-3, 2e-3, 0.0):
            rig.config.set("position-zero", zero_m)
        assert rig.record(tmp_path / "later.csv", 0.2)["lost_rows"] == 0
        for seconds in (0.0, np.nan, np.inf):
            with pytest.raises(tsa_rig.ArgumentError, match="seconds"):
                rig.record(tmp_path / "none.csv", seconds)
        with rig.recording(tmp_path / "move.csv") as log:
            rig.home()
            rig.move(0.004)
        told = tsa_rig.read_log(tmp_path / "move.csv")
        assert len(told["t_s"]) == log["rows"] and told["position_m"][-1] == pytest.approx(0.004, abs=2e-4)
        assert "request move 0.004" in (tmp_path / "move.csv").read_text()
        with pytest.raises(KeyError), rig.recording(tmp_path / "broken.csv"):
            raise KeyError("mine")
        assert "# broken_off = KeyError: 'mine'" in (tmp_path / "broken.csv").read_text()
        assert tsa_rig.read_log(tmp_path / "broken.csv") == {}, "nothing has passed"
        with pytest.raises(tsa_rig.OperationError, match="nowhere"):
            rig.record("/nowhere/log.csv", 1.0)

        found = rig.doctor()
        assert found["ok"] and found["port"] == "sim" and found["rig"] == "nominal"
        assert {"state", "drive", "LVDT", "link"} <= {check["name"] for check in found["checks"]}
    with tsa_rig.Rig("sim", scene=SCENE, programs=PROGRAMS, plant={"supply_voltage": "10V"}) as rig:
        found = rig.doctor()
        wrong = [check for check in found["checks"] if not check["ok"]]
        assert not found["ok"] and wrong and all(check["advice"] for check in wrong)


def test_a_board_gets_the_table_of_another_scene(tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text(SCENE.read_text().replace("rod_radius_m = 0.0005", "rod_radius_m = 0.00051"))
    assert other.read_text() != SCENE.read_text()
    with emulated() as rig:
        rig.home()
        before = rig.status()
        made = rig.make_table(other)
        after = rig.status()
        assert before["scene_matches"] and made["kept"] and made["bytes"] == after["table"]["bytes"]
        assert after["scene_matches"] and after["scene_hash"] == made["scene_hash"] != before["scene_hash"]
        with pytest.raises(tsa_rig.OperationError, match=r"home\(\)"):
            rig.move(0.004)
        with pytest.raises(FileNotFoundError):
            rig.make_table(tmp_path / "none.toml")
    # An emulated board has the table of its scene from the start.
    with tsa_rig.Rig("sim", scene=other, plant={"load": "0.5kg"}, programs=PROGRAMS) as rig:
        assert rig.status()["scene_hash"] == made["scene_hash"]
    with tsa_rig.Rig("sim", scene=other, programs=PROGRAMS, check_scene=False) as rig:
        assert not rig.status()["scene_matches"] and rig.make_table()["scene_hash"] == made["scene_hash"]


def test_what_a_board_has_learned_outlives_the_rig(tmp_path: Path) -> None:
    def calibrated() -> tsa_rig.Rig:
        return tsa_rig.Rig("sim", scene=SCENE, seed=7, flash=tmp_path / "rig.flash", programs=PROGRAMS)

    with calibrated() as rig:
        read = rig.calibrate("lvdt")
        rig.calibrate("lvdt", gap_m=read["true_gap_m"])
        offset = rig.config.get("lvdt-offset")
    assert offset["value"] != 0.0
    with calibrated() as rig:
        assert rig.config.get("lvdt-offset") == offset
        read = rig.calibrate("lvdt")
        assert read["gap_m"] == pytest.approx(read["true_gap_m"], abs=20e-6)
    with tsa_rig.Rig("sim", scene=SCENE, seed=7, programs=PROGRAMS) as rig:
        assert rig.config.get("lvdt-offset")["value"] == 0.0, "without the file each rig has a new board"


def test_a_plant_has_a_scene_or_a_program_of_its_own(tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text(SCENE.read_text().replace("stiffness_n_per_m = 1370.0", "stiffness_n_per_m = 1200.0"))
    assert other.read_text() != SCENE.read_text()
    program = f"{sys.executable} {ROOT / 'docs' / 'plants' / 'linear_spring.py'}"
    gaps = []
    plants: list[dict[str, Any]] = [{}, {"plant_scene": other}, {"plant_program": program}]
    for of_plant in plants:
        with tsa_rig.Rig("sim", scene=SCENE, rig="ideal", programs=PROGRAMS, **of_plant) as rig:
            assert rig.status()["scene_matches"]
            gaps.append(rig.calibrate("lvdt")["true_gap_m"])
    assert min(abs(gaps[0] - gaps[1]), abs(gaps[0] - gaps[2]), abs(gaps[1] - gaps[2])) > 1e-4, gaps


def test_what_only_an_emulated_rig_has_is_named(tmp_path: Path) -> None:
    emulated: dict[str, Any] = {"plant": {}, "flash": "x", "plant_scene": SCENE, "plant_program": "true"}
    for name, value in emulated.items():
        with pytest.raises(tsa_rig.ArgumentError, match=f"^{name} "):
            tsa_rig.Rig("/dev/no-such-device", scene=SCENE, **{name: value})
    missing: dict[str, Any] = {"flash": tmp_path / "none" / "x", "plant_scene": "none.toml"}
    for name, value in missing.items():
        with pytest.raises(FileNotFoundError, match="none"):
            tsa_rig.Rig("sim", scene=SCENE, programs=PROGRAMS, **{name: value})
