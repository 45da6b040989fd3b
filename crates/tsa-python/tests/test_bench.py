"""Many emulated rigs in this process, and that they do what the emulated board does."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
SCENE = ROOT / "scenes/default.toml"
PROGRAMS = os.environ.get("TSA_PROGRAMS")
HALF_KG = {"load": "0.5kg"}


def equal(one: dict[str, Any], other: dict[str, Any]) -> bool:
    same = (np.array_equal(one[k], other[k], equal_nan=one[k].dtype.kind == "f") for k in one)
    return one.keys() == other.keys() and all(same)


def test_it_homes_and_moves_as_the_emulated_board_does() -> None:
    seeds = [1, 2]
    bench = tsa_rig.Bench(SCENE, "nominal", seeds, HALF_KG)
    homed, moved = bench.home(), bench.move(0.008, speed=0.002)
    assert not homed["error"].any() and not moved["error"].any()
    for k, seed in enumerate(seeds):
        with tsa_rig.Rig("sim", scene=SCENE, rig="nominal", seed=seed, plant=HALF_KG, programs=PROGRAMS) as rig:
            of_board, moved_board = rig.home(), rig.move(0.008, speed=0.002)
        # docs/results.md, section `agreement`, has more plants.
        assert homed["load_n"][k] == pytest.approx(of_board["load_n"], abs=0.02)
        assert homed["reference_gap_m"][k] == pytest.approx(of_board["reference_gap_m"], abs=5e-6)
        assert homed["duration_s"][k] == pytest.approx(of_board["duration_s"], abs=0.1)
        assert moved["position_m"][k] == pytest.approx(moved_board["position_m"], abs=30e-6)
        assert moved["true_error_m"][k] == pytest.approx(moved_board["true_error_m"], abs=30e-6)
        assert moved.keys() - {"error"} == moved_board.keys() - {"off_target", "load_at_range_end"}
        board = rig.telemetry()
        assert set(board) - set(bench.telemetry()) == {"string_tension_n"}


def test_ticks_are_arrays_and_a_copy_goes_on_alike() -> None:
    bench = tsa_rig.Bench(tsa_rig.Scene.load(SCENE), seeds=range(3), plant=HALF_KG)
    assert bench.seeds.tolist() == [0, 1, 2] and not bench.error.any()
    bench.home()
    assert not bench.move([0.004, 0.008, 0.006], wait=False)["error"].any()
    copy = bench.copy()
    trace, same = bench.step(200), copy.step(200)
    assert equal(trace.telemetry, same.telemetry) and equal(trace.truth, same.truth)
    for columns in (trace.telemetry, trace.truth):
        assert {values.shape for values in columns.values()} == {(3, 200)}
    assert np.allclose(np.diff(trace.truth["t_s"], axis=1), 0.01)
    assert set(trace.telemetry["state"][:, 0]) == {"moving"}
    now = bench.telemetry()
    assert now["position_m"].shape == (3,) and np.array_equal(now["position_m"], trace.telemetry["position_m"][:, -1])
    assert np.array_equal(bench.truth()["gap_m"], trace.truth["gap_m"][:, -1])
    bench.step(600)
    assert np.allclose(bench.telemetry()["position_m"], [0.004, 0.008, 0.006], atol=2e-4)
    assert np.allclose(copy.telemetry()["position_m"], now["position_m"], equal_nan=True), "of its own"


def test_a_rig_that_fails_is_a_row_with_its_error() -> None:
    bench = tsa_rig.Bench(SCENE, "ideal", range(3), HALF_KG)
    homed = bench.home(load_n=[np.nan, 4.9, 500.0])
    assert np.array_equal(homed["error"] != "", [False, False, True]) and "load" in homed["error"][2]
    assert np.array_equal(np.isnan(homed["load_n"]), homed["error"] != "")
    moved = bench.move([0.004, 0.5, 0.004])
    assert moved["error"][0] == "" and "target is 0.5 m" in moved["error"][1] and "home()" in moved["error"][2]
    assert np.isnan(moved["position_m"][1:]).all() and moved["error_m"][0] == pytest.approx(0.0, abs=1e-4)
    broken = tsa_rig.Bench(SCENE, "ideal", [1, 2], {"load": "150N"})
    assert broken.error.all() and np.isnan(broken.step(3).truth["gap_m"]).all()
    assert broken.home()["error"].tolist() == broken.error.tolist()


def test_telemetry_says_what_homing_found_in_words() -> None:
    words = {}
    for load in ("0.07kg", "0.5kg", "2.0kg", "4.0kg"):
        bench = tsa_rig.Bench(SCENE, "ideal", [1], {"load": load})
        bench.home()
        now = bench.telemetry()
        words[load] = (now["load_at_range_end"][0], now["homing_failure"][0])
    beyond = ("", "load-out-of-range")
    assert words == {"0.07kg": ("low", ""), "0.5kg": ("", ""), "2.0kg": ("high", ""), "4.0kg": beyond}
    assert "load is 500" in bench.home(load_n=500.0)["error"][0]
    assert bench.telemetry()["homing_failure"][0] == "load-out-of-range", "no homing has begun since"


def test_a_plants_motor_turns_as_it_is_told() -> None:
    plant = tsa_rig.Plant(SCENE, "nominal", range(2), HALF_KG)
    assert not plant.error.any()
    before = plant.truth()
    trace = plant.step([100.0, -50.0], ticks=100)
    assert {values.shape for values in trace.truth.values()} == {(2, 100)}
    assert np.allclose(trace.truth["motor_speed_rad_per_s"][:, 50:], [[100.0], [-50.0]], rtol=0.05)
    assert np.allclose(trace.telemetry["drive_speed_rad_per_s"][:, 50:], [[100.0], [-50.0]], rtol=0.05)
    twisted = trace.truth["twist_rad"][:, -1] - before["twist_rad"]
    encoder = trace.telemetry["encoder_rad"]
    assert np.allclose(twisted, [100.0 / 62.0, -50.0 / 62.0], rtol=0.1), "the gear turns 62 times as much"
    assert np.allclose(encoder[:, -1] - encoder[:, 0], twisted, atol=0.1)
    assert np.allclose(trace.telemetry["gap_m"], trace.truth["gap_m"], atol=1e-3)
    copy = plant.copy()
    assert equal(plant.step(ticks=50).truth, copy.step(ticks=50).truth)
    # Without current nothing holds the strings.
    held, let_go = plant.step(ticks=100), copy.step(0.0, 0.0, ticks=100)
    assert np.abs(held.truth["motor_current_a"]).mean() > np.abs(let_go.truth["motor_current_a"][:, 5:]).max()


def test_arguments_are_refused_by_name() -> None:
    plant = tsa_rig.Plant(SCENE, "ideal", [1])
    for named, call in (
        ("seeds", lambda: tsa_rig.Bench(SCENE, seeds=[])),
        ("seeds", lambda: tsa_rig.Bench(SCENE, seeds=[-1])),
        ("rig", lambda: tsa_rig.Plant(SCENE, "soft")),
        ("weight", lambda: tsa_rig.Bench(SCENE, plant={"weight": 1})),
        ("load=-1", lambda: tsa_rig.Bench(SCENE, plant={"load": -1.0})),
        ("ticks", lambda: plant.step(ticks=0)),
        ("speed_rad_per_s", lambda: plant.step(1e9)),
        ("current_a", lambda: plant.step(1.0, -1.0)),
        (r"speed_rad_per_s of shape \(2,\)", lambda: plant.step([1.0, 2.0])),
    ):
        with pytest.raises(tsa_rig.ArgumentError, match=named):
            call()
