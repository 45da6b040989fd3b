"""A Gymnasium environment: a motor's speed and current raise a load to a height. `pip install gymnasium`.

Each episode is another emulated rig, which the seed of `reset` draws: the agent meets friction, stick-slip, hysteresis
and the noise of the sensors as they are on a rig as built. `step` lets 50 ms pass.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import tsa_rig
from numpy.typing import NDArray

Floats = NDArray[np.float32]

TICKS = 5
"""Ticks of 10 ms of one step."""
STEPS = 100
"""Steps of an episode."""
HEIGHTS_M = (0.002, 0.010)
"""Between which heights above the start a target is drawn (m)."""
PRETWIST = {"twist_at_boot": "3.1416rad"}
"""The strings begin at the half-turn pre-twist."""


class LiftEnv(gymnasium.Env[Floats, Floats]):
    """Raise the load to a height.

    Action, shape (2,): the speed of the motor shaft, from -1 to 1 of its maximum, and the current limit, from 0 to 1 of
    the scene's. Observation, shape (4,): height of the load above the start and of the target (mm), turns of the
    strings since the start, current (A); all as the sensors read them. Reward: minus the true distance from the target
    (mm).
    """

    def __init__(self, rig: str = "nominal", load: str = "0.5kg", scene: str = "scenes/default.toml") -> None:
        self._scene, self._rig, self._plant_keys = tsa_rig.Scene.load(scene), rig, {"load": load, **PRETWIST}
        self._low, self._high = np.array([[-1.0, 0.0], [1.0, 1.0]], dtype=np.float32)
        self.action_space = gymnasium.spaces.Box(self._low, self._high)
        # More than any rig has.
        high = np.array([200.0, 200.0, 100.0, 50.0], dtype=np.float32)
        self.observation_space = gymnasium.spaces.Box(-high, high)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**32))
        self._plant = tsa_rig.Plant(self._scene, self._rig, [drawn], self._plant_keys)
        if self._plant.error[0]:
            raise RuntimeError(f"rig {drawn}: {self._plant.error[0]}")
        self._height_m, self._steps = float(self.np_random.uniform(*HEIGHTS_M)), 0
        self._start, self._true_start_m = self._plant.telemetry(), self._plant.truth()["gap_m"][0]
        return self._observed(self._start), {"seed": drawn}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        speed, current = np.clip(action, self._low, self._high)
        trace = self._plant.step(
            float(speed) * self._plant.speed_max_rad_per_s, float(current) * self._plant.current_limit_a, TICKS
        )
        self._steps += 1
        height_m = self._true_start_m - trace.truth["gap_m"][0, -1]
        reward = -1e3 * abs(float(height_m) - self._height_m)
        observed = self._observed({name: values[:, -1] for name, values in trace.telemetry.items()})
        return observed, reward, False, self._steps >= STEPS, {"height_m": float(height_m)}

    def _observed(self, told: dict[str, NDArray[Any]]) -> Floats:
        height_m = self._start["gap_m"][0] - told["gap_m"][0]
        turns = (told["encoder_rad"][0] - self._start["encoder_rad"][0]) / (2.0 * np.pi)
        current_a = told["drive_current_a"][0]
        return np.array([1e3 * height_m, 1e3 * self._height_m, turns, current_a], dtype=np.float32)


if __name__ == "__main__":
    env = LiftEnv()
    observed, about = env.reset(seed=1)
    done, reward = False, 0.0
    while not done:
        # A proportional controller: 0.3 of the motor's speed for each millimetre.
        action = np.array([0.3 * (observed[1] - observed[0]), 1.0], dtype=np.float32)
        observed, reward, _, done, about = env.step(action)
    print(f"target {observed[1]:.2f} mm, reached {observed[0]:.2f} mm, truly {-1e3 * reward:.0f} µm from it")
