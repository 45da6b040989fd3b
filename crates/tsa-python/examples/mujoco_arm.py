"""A MuJoCo arm that the actuator raises. `pip install mujoco`.

The twisted strings are a MuJoCo tendon from a fixed anchor to a lever of the arm. The tendon's length is the gap
between the actuator's clamps, and a general actuator pulls it with the force that the mechanism has at this gap and
twist. The motor turns the strings towards a wanted twist, no faster than the scene's can.
"""

from __future__ import annotations

import mujoco
import numpy as np
import tsa_rig

MASS_KG, LENGTH_M, LEVER_M = 0.2, 0.2, 0.05
"""Of the arm, a uniform rod, and where the strings are tied to it."""
DAMPING = 0.02
"""Of the elbow (N m s/rad)."""
LAG_S = 0.05
"""Time constant with which the drive follows a step of the wanted twist."""
MODEL = f"""
<mujoco>
  <option timestep="0.0005"><flag energy="enable"/></option>
  <worldbody>
    <site name="anchor" pos="{LEVER_M} 0 %r"/>
    <body>
      <joint name="elbow" axis="0 -1 0" damping="{DAMPING}"/>
      <geom type="capsule" fromto="0 0 0 {LENGTH_M} 0 0" size="0.01" mass="{MASS_KG}"/>
      <site name="lever" pos="{LEVER_M} 0 0"/>
    </body>
  </worldbody>
  <tendon><spatial name="strings"><site site="anchor"/><site site="lever"/></spatial></tendon>
  <actuator><general name="pull" tendon="strings"/></actuator>
</mujoco>
"""


class Arm:
    """The arm, level and at rest, with the strings at `turns` past the half-turn pre-twist."""

    def __init__(self, turns: float = 2.0, scene: str = "scenes/default.toml") -> None:
        loaded = tsa_rig.Scene.load(scene)
        self.mechanism, drive = loaded.mechanism(), loaded.as_dict()["rig"]
        gear = drive["gear_ratio"][0] / drive["gear_ratio"][1]
        self._turns_per_s = drive["motor_speed_max_rad_per_s"] / gear / (2.0 * np.pi)
        self.turns = turns
        tension_n = MASS_KG * 9.81 * 0.5 * LENGTH_M / LEVER_M
        self.model = mujoco.MjModel.from_xml_string(MODEL % float(self.mechanism.solve(tension_n, turns).gap_m))
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def step(self, wanted_turns: float) -> tsa_rig.Equilibria:
        """One time step of MuJoCo. Returns the mechanism's state, whose `load_n` was the pull (N) meanwhile.

        Raises RuntimeError if no pull holds the gap at this twist, for example because the strings are slack.
        """
        held = self.mechanism.force(self.data.ten_length[0], self.turns)
        if held.error:
            raise RuntimeError(str(held.error))
        # A positive force would lengthen the tendon.
        self.data.ctrl[0] = -held.load_n
        mujoco.mj_step(self.model, self.data)
        speed = np.clip((wanted_turns - self.turns) / LAG_S, -self._turns_per_s, self._turns_per_s)
        self.turns += float(speed) * self.model.opt.timestep
        return held


if __name__ == "__main__":
    arm = Arm()
    for wanted_turns in (2.0, 4.0, 5.0):
        for _ in range(4000):
            held = arm.step(wanted_turns)
        angle_deg = np.degrees(arm.data.qpos[0])
        print(f"{arm.turns:.2f} turns: arm at {angle_deg:.1f}°, strings pull {held.load_n:.2f} N")
