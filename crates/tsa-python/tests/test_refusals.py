"""Arguments that are wrong in a plausible way: the refusal names them, and nothing is computed for another value."""

import copy
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
SCENE = ROOT / "scenes/default.toml"
PROGRAMS = os.environ.get("TSA_PROGRAMS")


@pytest.mark.parametrize("seed", [1.5, "1", -1, 2**64, None])
def test_a_seed_is_a_whole_number(seed: Any) -> None:
    with pytest.raises(tsa_rig.ArgumentError, match="seeds"):
        tsa_rig.Plant(SCENE, seeds=[seed])
    with pytest.raises(tsa_rig.ArgumentError, match="seed"):
        tsa_rig.Rig("sim", scene=SCENE, seed=seed)


@pytest.mark.parametrize("plant", ["load=0.5kg", ["load"]])
def test_changes_of_a_plant_are_a_mapping(plant: Any) -> None:
    with pytest.raises(tsa_rig.ArgumentError, match="plant"):
        tsa_rig.Plant(SCENE, plant=plant)
    with pytest.raises(tsa_rig.ArgumentError, match="plant"):
        tsa_rig.Rig("sim", scene=SCENE, plant=plant)


def test_constants_may_be_numbers_and_arrays_of_numpy() -> None:
    scene = tsa_rig.Scene.load(SCENE)
    values = {"rod_radius_m": np.float32(5e-4), "encoder_lines": np.int64(512), "rig.gear_ratio": np.array([53, 1])}
    changed = scene.with_constants(**values).as_dict()
    assert changed["rig"]["gear_ratio"] == [53, 1] and changed["rig"]["encoder_lines"] == 512
    with pytest.raises(tsa_rig.ArgumentError, match="cannot stand in a scene"):
        scene.with_constants(rod_radius_m=b"5")


def test_a_scene_can_be_pickled_and_copied() -> None:
    scene = tsa_rig.Scene.load(SCENE).with_constants(k2=0.1 + 0.2)
    for other in (pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene)):
        assert other.as_dict() == scene.as_dict()


def test_answers_can_be_compared() -> None:
    scene = tsa_rig.Scene.load(SCENE)
    solved, looked = scene.mechanism().solve([1.0, 2.0], 3.0), scene.table().lookup([1.0, 2.0], 3.0)
    assert solved == solved and looked == looked
    assert solved != scene.mechanism().solve([1.0, 2.0], 3.0)


def test_what_is_no_log_is_named(tmp_path: Path) -> None:
    log, binary = tmp_path / "log.csv", tmp_path / "binary"
    log.write_text("# format = tsa-log 1\nt_s,state\nabc,ready\n# end rows = 1\n")
    binary.write_bytes(b"\xff\xfe\x95")
    for path, word in ((log, "t_s `abc`"), (binary, "binary"), (tmp_path, "not a log")):
        with pytest.raises(tsa_rig.ArgumentError, match=word):
            tsa_rig.read_log(path)


def test_sweeps_are_a_list() -> None:
    with pytest.raises(tsa_rig.ArgumentError, match="sweeps"):
        tsa_rig.identify("new.csv", SCENE)


def test_times_and_gaps_of_a_rig_are_named() -> None:
    with tsa_rig.Rig("sim", scene=SCENE, programs=PROGRAMS) as rig:
        for seconds in (-1.0, float("nan"), float("inf")):
            with pytest.raises(tsa_rig.ArgumentError, match="seconds"):
                rig.wait(seconds)
        with pytest.raises(tsa_rig.ArgumentError, match="seconds"):
            next(rig.rows(float("nan")))
        for point in ((0.1,), (0.1, float("nan")), "ab"):
            with pytest.raises(tsa_rig.ArgumentError, match="point"):
                rig.calibrate("lvdt", gap_m=0.1, point=point)  # type: ignore[arg-type]
        with pytest.raises(tsa_rig.ArgumentError, match="gap_m"):
            rig.calibrate("lvdt", gap_m=float("nan"))
        with pytest.raises(tsa_rig.MissingFileError, match="points"):
            rig.calibrate("lvdt", points="nope.csv")
        assert rig.config.get("lvdt-offset")["value"] == 0.0
        assert rig.calibrate("lvdt", gap_m=0.1, point=np.array([0.089, 0.0895]))["kept"]  # type: ignore[arg-type]
