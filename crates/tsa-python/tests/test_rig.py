"""The client, on the emulated board."""

import os
import signal
import threading
from pathlib import Path

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
        with pytest.raises(RuntimeError, match="refused: target|too-fast"):
            rig.track([0.0, 10.0], [0.006, 0.04])
        assert rig.telemetry()["state"][-1] in ("moving", "holding")


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
    with pytest.raises(RuntimeError, match="rig-emulator"):
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
