#!/usr/bin/env python3
"""A plant program: a load on a linear spring that twisting makes shorter. Run by `rigctl ... --plant-program`.

Lines come on standard input and are answered on standard output, one for one, numbers in SI units
(crates/rig-plant/README.md).
"""

import sys

LENGTH_M = 0.095  # of the unloaded spring, at zero twist
STIFFNESS_N_PER_M = 1500.0
SHORTENING_M_PER_RAD2 = 6e-6  # the spring is shorter by this times the square of the twist
DAMPING_N_S_PER_M = 8.0
GRAVITY = 9.80665


class Plant:
    def __init__(self, step_s, twist_rad):
        self.step_s = step_s
        self.load_n = 0.5 * GRAVITY
        self.gap_m = self.rest_m(twist_rad) + self.load_n / STIFFNESS_N_PER_M
        self.speed = 0.0

    @staticmethod
    def rest_m(twist_rad):
        return LENGTH_M - SHORTENING_M_PER_RAD2 * twist_rad**2

    def step(self, twist_rad):
        pull_n = max(0.0, STIFFNESS_N_PER_M * (self.gap_m - self.rest_m(twist_rad)))
        mass = self.load_n / GRAVITY
        # Semi-implicit Euler: the speed first, with the damping at its end.
        self.speed = (self.speed + self.step_s * (self.load_n - pull_n) / mass) / (
            1.0 + self.step_s * DAMPING_N_S_PER_M / mass
        )
        self.gap_m += self.step_s * self.speed
        # Virtual work: the shaft gets what the shortening does to the pull.
        torque_nm = -2.0 * SHORTENING_M_PER_RAD2 * twist_rad * pull_n
        return f"{self.gap_m!r} {torque_nm!r} {pull_n!r}"


def main():
    plant = None
    for line in sys.stdin:
        word, *rest = line.split()
        if word == "start":  # version, step, twist, seed
            plant = Plant(float(rest[1]), float(rest[2]))
            answer = "ok" if rest[0] == "1" else "error only version 1 is spoken here"
        elif word == "set" and rest[0] == "load":
            plant.load_n = float(rest[1])
            answer = "ok"
        elif word == "step":
            answer = plant.step(float(rest[0]))
        elif word == "quit":
            return
        else:
            answer = "unknown"
        print(answer, flush=True)


main()
