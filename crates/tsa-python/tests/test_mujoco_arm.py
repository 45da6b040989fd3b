"""The MuJoCo arm of `examples/mujoco_arm.py`."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
pytest.importorskip("mujoco", reason="mujoco is not installed: pip install mujoco", exc_type=ImportError)


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "crates/tsa-python/examples/mujoco_arm.py"), run_name="example")


def raised(example: dict[str, Any], turns: float) -> Any:
    arm = example["Arm"](scene=str(ROOT / "scenes/default.toml"))
    while arm.data.time < 3.0:
        arm.step(turns)
    assert abs(arm.data.qvel[0]) < 1e-4, "it is at rest"
    return arm


def test_at_rest_the_strings_carry_the_arm_and_a_turn_lifts_it_by_the_ratio(example: dict[str, Any]) -> None:
    gaps_m = []
    for turns in (4.0, 4.02):
        arm = raised(example, turns)
        held = arm.step(turns)
        angle = arm.data.qpos[0]
        lever = example["LEVER_M"] * np.array([np.cos(angle), np.sin(angle)])
        along = arm.model.site_pos[0][[0, 2]] - lever
        along /= np.linalg.norm(along)
        moment_nm = held.load_n * (lever[0] * along[1] - lever[1] * along[0])
        weight_nm = example["MASS_KG"] * 9.81 * 0.5 * example["LENGTH_M"] * np.cos(angle)
        assert moment_nm == pytest.approx(weight_nm, rel=1e-3) and angle > 0.1
        gaps_m.append(arm.data.ten_length[0])
    lifted_m = gaps_m[0] - gaps_m[1]
    assert 2.0 * np.pi * 0.02 / lifted_m == pytest.approx(held.tr_rad_per_m, rel=0.02)


def test_up_and_back_the_motor_gives_what_the_damper_takes(example: dict[str, Any]) -> None:
    arm = example["Arm"](scene=str(ROOT / "scenes/default.toml"))
    start_j, rows = arm.data.energy.sum(), []
    while arm.data.time < 4.0:
        held = arm.step(4.0 if arm.data.time < 1.5 else 2.0)
        rows.append((held.load_n, held.turns, arm.data.qvel[0], arm.data.energy.sum() - start_j))
    loads, turns, speeds, arm_j = np.array(rows).T
    torque_nm = arm.mechanism.solve(loads, turns).torque_nm
    twist_rad, top = 2.0 * np.pi * turns, turns.argmax()
    up_j, net_j = np.trapezoid(torque_nm[:top], twist_rad[:top]), np.trapezoid(torque_nm, twist_rad)
    damped_j = example["DAMPING"] * np.sum(speeds**2) * arm.model.opt.timestep
    assert abs(arm_j[-1]) < 1e-4 * up_j and up_j > arm_j[top] > 0.01
    assert net_j == pytest.approx(damped_j, rel=0.03)


def test_strings_that_nothing_holds_are_refused(example: dict[str, Any]) -> None:
    arm = example["Arm"](scene=str(ROOT / "scenes/default.toml"))
    arm.turns = 40.0
    with pytest.raises(RuntimeError, match="40 turns"):
        arm.step(40.0)
