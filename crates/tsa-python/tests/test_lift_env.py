"""The Gymnasium environment of `examples/lift_env.py`."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]
CHECKER = pytest.importorskip(
    "gymnasium.utils.env_checker", reason="gymnasium is not installed: pip install gymnasium", exc_type=ImportError
)


@pytest.fixture(scope="module")
def make() -> Any:
    example = runpy.run_path(str(ROOT / "crates/tsa-python/examples/lift_env.py"), run_name="example")
    return lambda: example["LiftEnv"](scene=str(ROOT / "scenes/default.toml"))


def test_it_is_an_environment_as_gymnasium_wants_it(make: Any) -> None:
    CHECKER.check_env(make(), skip_render_check=True)


def test_a_controller_lifts_the_load_and_a_seed_is_one_episode(make: Any) -> None:
    ends = []
    for gain in (0.3, 0.3, 0.0):
        env = make()
        observed, _ = env.reset(seed=3)
        done, reward = False, 0.0
        while not done:
            action = np.array([gain * (observed[1] - observed[0]), 1.0], dtype=np.float32)
            observed, reward, _, done, _ = env.step(action)
        ends.append((reward, *observed))
    assert ends[0] == ends[1], "the same rig, noise and target"
    assert ends[0][0] > -0.2 and ends[2][0] < -1.0, f"{ends}: in mm from the target, with and without control"
