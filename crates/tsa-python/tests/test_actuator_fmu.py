"""The FMU that `examples/actuator_fmu.py` makes, simulated by FMPy."""

from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
pythonfmu3 = pytest.importorskip("pythonfmu3", reason="it is not installed: pip install pythonfmu3")
fmpy = pytest.importorskip("fmpy", reason="it is not installed: pip install fmpy")
MECHANISM = tsa_rig.Scene.load(ROOT / "scenes/default.toml").mechanism()


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> str:
    example = ROOT / "crates/tsa-python/examples/actuator_fmu.py"
    return str(pythonfmu3.FmuBuilder.build_FMU(example, tmp_path_factory.mktemp("fmu")))


def simulated(fmu: str, points: list[tuple[float, float]], **parameters: object) -> Any:
    twist = np.array(points, dtype=[("time", float), ("twist_rad", float)])
    values = {"scene": str(ROOT / "scenes/default.toml"), **parameters}
    return fmpy.simulate_fmu(fmu, start_values=values, input=twist, output_interval=0.002, stop_time=points[-1][0])


def test_it_comes_to_rest_where_the_model_is(fmu: str) -> None:
    turns = 3.0
    points = [(0.0, np.pi), (0.5, np.pi), (1.5, np.pi + 2.0 * np.pi * turns), (4.0, np.pi + 2.0 * np.pi * turns)]
    told = simulated(fmu, points, mass_kg=0.8, damping_n_s_per_m=10.0)
    assert np.abs(told["position_m"][:200]).max() < 1e-9, "at rest from the start"
    solved = MECHANISM.solve(0.8 * 9.80665, turns)
    assert told["position_m"][-1] == pytest.approx(solved.contraction_m, abs=1e-6)
    assert told["force_n"][-1] == pytest.approx(0.8 * 9.80665, rel=1e-4)


def test_it_oscillates_as_the_linear_model(fmu: str) -> None:
    twist_rad, step_rad = 5.0 * np.pi, 0.1
    points = [(0.0, twist_rad), (0.1, twist_rad), (0.12, twist_rad + step_rad), (1.0, twist_rad + step_rad)]
    told = simulated(fmu, points, mass_kg=0.5, damping_n_s_per_m=3.0, twist_rad=twist_rad)
    system = control.ss(*MECHANISM.linearise(0.5 * 9.80665, 2.0, damping_n_s_per_m=3.0))
    input_rad = np.interp(told["time"], *np.transpose(points)) - twist_rad
    expected_m = control.forced_response(system, told["time"], input_rad).outputs
    moved_m = told["position_m"] - told["position_m"][0]
    assert np.abs(moved_m - expected_m).max() < 0.05 * np.ptp(moved_m)
    assert np.ptp(moved_m) > 1.5 * moved_m[-1], "it overshoots"


def test_a_load_that_nothing_carries_ends_the_simulation(fmu: str) -> None:
    with pytest.raises(Exception, match="fmi3ExitInitializationMode"):
        simulated(fmu, [(0.0, np.pi), (0.1, np.pi)], mass_kg=-1.0)
    with pytest.raises(Exception, match="fmi3DoStep"):
        simulated(fmu, [(0.0, np.pi), (0.1, 500.0), (0.2, 500.0)], mass_kg=0.5)
