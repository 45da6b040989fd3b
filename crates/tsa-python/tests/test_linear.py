"""The linear model, against the emulated plant, whose own code integrates the full model."""

from pathlib import Path

import control
import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
SCENE = tsa_rig.Scene.load(ROOT / "scenes/default.toml")
TICK_S = 0.01
# Of the emulated rail (N s/m), and in proportion to the stiffness, of its rods and strings (s).
RAIL, STRUCTURE_S = 2.0, 2e-3


@pytest.mark.parametrize(("load_n", "turns"), [(5.0, 1.0), (5.0, 5.0), (12.0, 3.0)])
def test_its_oscillation_and_its_gain_are_those_of_the_plant(load_n: float, turns: float) -> None:
    keys = {"load": f"{load_n}N", "friction": "0N", "damping": f"{RAIL}Ns/m"}
    keys["twist_at_boot"] = f"{np.pi + 2.0 * np.pi * turns}rad"
    plant = tsa_rig.Plant(SCENE, "ideal", [1], keys)
    plant.step(ticks=500)
    before = plant.truth()
    plant.step(300.0, ticks=4)
    after = plant.step(0.0, ticks=500).truth
    gap_m, twist_rad = after["gap_m"][0], after["twist_rad"][0]

    mechanism = SCENE.mechanism()
    middle = float(0.5 * (before["twist_rad"][0] + twist_rad[-1]) / (2.0 * np.pi) - 0.5)
    damping = RAIL + STRUCTURE_S / float(mechanism.solve(load_n, middle).dgap_dload_m_per_n)
    system = control.ss(*mechanism.linearise(load_n, middle, damping_n_s_per_m=damping))

    # What hangs freely repeats itself as poles say: gap[k+2] = a gap[k+1] + b gap[k] + c.
    free = gap_m[10:60]
    (a, b, _), *_ = np.linalg.lstsq(np.column_stack([free[1:-1], free[:-2], np.ones(48)]), free[2:], rcond=None)
    pole = np.log(np.roots([1.0, -a, -b])[0]) / TICK_S
    expected = system.poles()[0]
    assert abs(pole) == pytest.approx(abs(expected), rel=0.01), "the resonance frequency (rad/s)"
    assert pole.real == pytest.approx(expected.real, rel=0.05), "the damping"
    rise_m, turned_rad = before["gap_m"][0] - gap_m[-1], twist_rad[-1] - before["twist_rad"][0]
    assert control.dcgain(system) == pytest.approx(rise_m / turned_rad, rel=0.01)
    assert control.dcgain(system) * mechanism.solve(load_n, middle).tr_rad_per_m == pytest.approx(1.0)


def test_what_moves_may_be_another_mass_than_the_loads() -> None:
    mechanism = SCENE.mechanism()
    one, four = (control.ss(*mechanism.linearise(5.0, 3.0, mass_kg=mass)) for mass in (0.2, 0.8))
    assert abs(one.poles()[0]) == pytest.approx(2.0 * abs(four.poles()[0]))
    assert control.dcgain(one) == pytest.approx(control.dcgain(four))
    # At zero twist turning does not lift, and TR is infinite.
    assert np.abs(mechanism.linearise(5.0, -0.5).B).max() < 1e-9


def test_what_is_out_of_range_is_named() -> None:
    mechanism = SCENE.mechanism()
    for arguments, named in [
        ((5.0, 40.0), "load_n 5.0, turns 40.0"),
        ((-1.0, 3.0), "load_n -1.0"),
        (([5.0, 6.0], 3.0), "load_n"),
        ((5.0, np.nan), "turns nan"),
        ((5.0, 3.0, 0.0), "mass_kg 0.0"),
        ((5.0, 3.0, "heavy"), "mass_kg"),
        ((5.0, 3.0, 0.5, -1.0), "damping_n_s_per_m -1.0"),
    ]:
        with pytest.raises(tsa_rig.ArgumentError, match=named):
            mechanism.linearise(*arguments)  # type: ignore[arg-type]
