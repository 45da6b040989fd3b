"""The actuator as an FMU (FMI 3, co-simulation): a load that hangs from the strings, while another model turns them.

`pip install pythonfmu3`, then `pythonfmu3 build -f actuator_fmu.py` writes Actuator.fmu. The FMU runs in the Python of
the program that loads it, in which `tsa_rig` must be installed.
"""

from math import ceil, pi

import tsa_rig
from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3Variability, String
from pythonfmu3.enums import Fmi3Initial

STEP_S = 5e-4
"""Longest step of the load's motion (s)."""
GRAVITY = 9.80665


class Actuator(Fmi3Slave):
    """`mass_kg` hangs at rest when the simulation starts. The twist is constant within a communication step."""

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self.time, self.twist_rad = 0.0, pi
        self.mass_kg, self.damping_n_s_per_m, self.scene = 0.5, 3.0, "scenes/default.toml"
        self.position_m, self.force_n = 0.0, self.mass_kg * GRAVITY
        self.register_variable(
            Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        )
        for name, about in [
            ("mass_kg", "Mass of the load (kg)"),
            ("damping_n_s_per_m", "Viscous damping of rail, rods and strings (N s/m)"),
        ]:
            self._register(Float64, name, about, Fmi3Causality.parameter, Fmi3Variability.fixed)
        self._register(String, "scene", "Scene file", Fmi3Causality.parameter, Fmi3Variability.fixed)
        about = "Twist of the strings (rad), pi at the half-turn pre-twist"
        self._register(Float64, "twist_rad", about, Fmi3Causality.input, Fmi3Variability.continuous)
        for name, about in [
            ("position_m", "Height of the load above where it hangs at the half-turn pre-twist (m)"),
            ("force_n", "Pull of the strings on the load (N)"),
        ]:
            self._register(Float64, name, about, Fmi3Causality.output, Fmi3Variability.continuous)

    def _register(self, kind: type, name: str, about: str, causality: object, variability: object) -> None:
        initial = Fmi3Initial.calculated if causality == Fmi3Causality.output else Fmi3Initial.exact
        self.register_variable(
            kind(name, causality=causality, variability=variability, description=about, initial=initial)
        )

    def exit_initialization_mode(self) -> None:
        self._mechanism = tsa_rig.Scene.load(self.scene).mechanism()
        weight_n = self.mass_kg * GRAVITY
        start = self._mechanism.solve(weight_n, [0.0, self._turns()])
        _known(start)
        (self._pretwist_gap_m, self._gap_m), self._speed_m_per_s = start.gap_m, 0.0
        self.position_m, self.force_n = self._pretwist_gap_m - self._gap_m, weight_n

    def _turns(self) -> float:
        return (self.twist_rad - pi) / (2.0 * pi)

    def do_step(self, current_time: float, step_size: float) -> bool:
        count = ceil(step_size / STEP_S)
        for _ in range(count):
            # The speed first: this keeps the energy of an oscillation.
            pull_n = float(_known(self._mechanism.force(self._gap_m, self._turns())).load_n)
            push_n = self.mass_kg * GRAVITY - pull_n - self.damping_n_s_per_m * self._speed_m_per_s
            self._speed_m_per_s += push_n / self.mass_kg * step_size / count
            self._gap_m += self._speed_m_per_s * step_size / count
        self.force_n = float(_known(self._mechanism.force(self._gap_m, self._turns())).load_n)
        self.position_m = self._pretwist_gap_m - self._gap_m
        return True


def _known(state: tsa_rig.Equilibria) -> tsa_rig.Equilibria:
    if state.error.any():
        raise ValueError(" ".join(state.error.flat))
    return state
