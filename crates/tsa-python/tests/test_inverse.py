"""The mechanism the other way round, and its torque."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
LOADS, TURNS = np.meshgrid(np.geomspace(0.4, 15.0, 9), np.linspace(-0.4, 6.0, 9))


@pytest.fixture(scope="module")
def mechanism() -> tsa_rig.Mechanism:
    return tsa_rig.Scene.load(ROOT / "scenes/default.toml").mechanism()


def test_a_force_and_a_twist_lead_back_to_the_gap(mechanism: tsa_rig.Mechanism) -> None:
    solved = mechanism.solve(LOADS, TURNS)
    assert not solved.error.any()
    by_force, by_twist = mechanism.force(solved.gap_m, TURNS), mechanism.twist(LOADS, solved.gap_m)
    for found in (by_force, by_twist):
        assert not found.error.any() and found.load_n.shape == LOADS.shape
        assert np.abs(found.gap_m - solved.gap_m).max() < 1e-12
        assert np.allclose(found.load_n, LOADS, rtol=1e-8) and np.allclose(found.turns, TURNS, atol=1e-7)
        assert np.allclose(found.dgap_dload_m_per_n, solved.dgap_dload_m_per_n, rtol=1e-6)


def test_they_broadcast_and_what_nothing_holds_is_nan_with_a_reason(mechanism: tsa_rig.Mechanism) -> None:
    forces = mechanism.force([0.2, 0.09, 0.01, np.nan], [[3.0], [4.0]])
    assert forces.load_n.shape == (2, 4) and np.array_equal(np.isnan(forces.load_n), forces.error != "")
    assert np.array_equal(forces.error != "", [[True, False, True, True]] * 2)
    assert "gap_m 0.2" in forces.error[0, 0] and "finite" in forces.error[0, 3]
    twists = mechanism.twist([5.0, 5.0, 5.0, -1.0], [0.09, 0.2, 0.01, 0.09])
    assert np.array_equal(np.isnan(twists.turns), [False, True, True, True])
    assert "at most" in twists.error[1] and "overtwist" in twists.error[2] and "load" in twists.error[3]
    assert np.isnan(twists.gap_m[1:]).all() and twists.load_n[0] == 5.0
    with pytest.raises(tsa_rig.ArgumentError, match=r"gap_m of shape \(2,\) and turns of shape \(3,\)"):
        mechanism.force([0.09, 0.09], [1.0, 2.0, 3.0])
    with pytest.raises(tsa_rig.ArgumentError, match="gap_m"):
        mechanism.twist(5.0, "wide")


def test_the_torque_conserves_energy(mechanism: tsa_rig.Mechanism) -> None:
    loads, turns, step = LOADS[:-1, 1:], TURNS[:-1, 1:], 1e-3
    above, below = (mechanism.solve(loads * (1.0 + side), turns).torque_nm for side in (step, -step))
    slope = mechanism.solve(loads, turns).dgap_dtwist_m_per_rad
    assert np.allclose((above - below) / (2.0 * step * loads), -slope, rtol=0.01)
    kept = pickle.loads(pickle.dumps(mechanism.solve(5.0, 3.0)))
    assert kept.torque_nm == mechanism.solve(5.0, 3.0).torque_nm > 0.0 and kept.gap_m > 0.0
    twisted = mechanism.solve(5.0, 7.0)
    assert np.isnan(twisted.torque_nm) and np.isfinite(twisted.gap_m) and not twisted.error, "0.3 N cannot be there"


def test_the_package_says_its_version() -> None:
    manifest = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    assert f'version = "{tsa_rig.__version__}"' in manifest
