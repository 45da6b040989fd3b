"""The model and the table, against the reference file and against each other."""

import csv
from pathlib import Path

import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
DEFAULT = ROOT / "scenes" / "default.toml"


@pytest.fixture(scope="module")
def scene() -> tsa_rig.Scene:
    return tsa_rig.Scene.load(DEFAULT)


def test_equilibria_are_those_of_the_reference() -> None:
    with (ROOT / "host-tests/reference/equilibria.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["scene"] == "paper-printed"]
    assert len(rows) > 10
    mechanism = tsa_rig.Scene.load(ROOT / "scenes/paper-printed.toml").mechanism()
    loads, turns = (np.array([float(row[key]) for row in rows]) for key in ("load_n", "turns"))
    solved = mechanism.solve(loads, turns)
    assert not solved.error.any()
    for key in rows[0].keys() - {"scene"}:
        expected = np.array([float(row[key]) for row in rows])
        found = getattr(solved, key)
        # The reference has its ratios from differences.
        assert np.allclose(found, expected, rtol=1e-7 if key == "tr_rad_per_m" else 1e-8, atol=1e-12), key


def test_loads_and_turns_broadcast_and_bad_shapes_are_refused(scene: tsa_rig.Scene) -> None:
    mechanism = scene.mechanism()
    assert mechanism.solve(5.0, 3.0).contraction_m.shape == ()
    grid = mechanism.solve(np.array([[2.0], [9.0]]), np.linspace(0.0, 6.0, 5))
    assert grid.gap_m.shape == (2, 5) and grid.load_n.shape == (2, 5)
    assert np.all(np.diff(grid.contraction_m, axis=1) > 0.0)
    assert mechanism.solve([], []).gap_m.shape == (0,)
    with pytest.raises(ValueError, match="broadcast"):
        mechanism.solve([1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError):
        mechanism.solve("five", 3.0)


def test_refused_states_are_nan_with_a_reason(scene: tsa_rig.Scene) -> None:
    solved = scene.mechanism().solve([5.0, np.nan, -1.0, 5.0], [3.0, 3.0, 3.0, 400.0])
    assert np.isfinite(solved.gap_m[0]) and np.isnan(solved.gap_m[1:]).all()
    assert solved.error[0] == "" and all(solved.error[1:]) and "finite" in solved.error[1]


def test_derivatives_are_those_of_the_gap(scene: tsa_rig.Scene) -> None:
    mechanism, step = scene.mechanism(), 1e-4
    at = mechanism.solve(5.0, 3.0)
    by_load = (mechanism.solve(5.0 + step, 3.0).gap_m - mechanism.solve(5.0 - step, 3.0).gap_m) / (2.0 * step)
    by_turns = (mechanism.solve(5.0, 3.0 + step).gap_m - mechanism.solve(5.0, 3.0 - step).gap_m) / (2.0 * step)
    assert at.dgap_dload_m_per_n == pytest.approx(by_load, rel=1e-6)
    assert at.dgap_dtwist_m_per_rad == pytest.approx(by_turns / (2.0 * np.pi), rel=1e-6)
    assert at.tr_rad_per_m == pytest.approx(-1.0 / at.dgap_dtwist_m_per_rad)


def test_the_table_answers_as_the_model_within_its_errors(scene: tsa_rig.Scene) -> None:
    table, (loads, turns) = scene.table(), np.meshgrid(np.linspace(1.0, 14.0, 9), np.linspace(0.5, 7.0, 9))
    looked, solved = table.lookup(loads, turns), scene.mechanism().solve(loads, turns)
    assert table.bytes > 0 and not looked.error.any()
    assert np.abs(looked.contraction_m - solved.contraction_m).max() <= table.contraction_error_m
    assert np.abs(looked.tr_rad_per_m / solved.tr_rad_per_m - 1.0).max() <= table.tr_relative_error
    outside = table.lookup([5.0, 500.0], 3.0)
    assert np.isnan(outside.gap_m[1]) and "load" in outside.error[1] and outside.error[0] == ""


def test_a_million_points_are_solved(scene: tsa_rig.Scene) -> None:
    looked = scene.table().lookup(np.linspace(1.0, 14.0, 1_000_000), 3.0)
    assert looked.gap_m.size == 1_000_000 and np.all(np.diff(looked.gap_m) >= -1e-7)


def test_bad_scenes_are_named(tmp_path: Path) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_text(DEFAULT.read_text().replace("[string]", "[strings]"))
    with pytest.raises(ValueError, match="strings"):
        tsa_rig.Scene.load(bad)
    with pytest.raises(FileNotFoundError, match="missing.toml"):
        tsa_rig.Scene.load(tmp_path / "missing.toml")


def test_the_tools_answer_as_dictionaries(tmp_path: Path) -> None:
    rows = tsa_rig.published(DEFAULT)
    assert len(rows) > 20
    assert tsa_rig.budget(DEFAULT, rig="hard")
    with pytest.raises(RuntimeError, match="none.csv"):
        tsa_rig.identify([tmp_path / "none.csv"], DEFAULT)
    with pytest.raises(ValueError, match="rig"):
        tsa_rig.budget(DEFAULT, rig="soft")
