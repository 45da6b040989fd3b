#!/usr/bin/env python3
"""A plant program: a twisted pair of strings held apart by leaf springs. Run by `rigctl ... --plant-program`.

It has the size of the default scene's rig and none of its equations (docs/explanation/model.md): the strings are
squeezed thinner by what they press on each other, instead of growing with the twist; they stiffen as they stretch; the
leaf springs soften as they bend. All forces but friction are derivatives of one energy, and each part follows its force
with a damper.
Lines come on standard input and are answered on standard output, one for one, numbers in SI units
(crates/rig-plant/README.md).
"""

import sys
from math import acos, copysign, cos, hypot, log, sin, sqrt

GRAVITY = 9.80665
STRING_M = 0.097  # length of an unloaded string
STRING_N_PER_M, STRING_TOE_M = 1000.0, 0.006  # pull: first times stretch times (1 + stretch/second)
SPAN_M = 0.032  # distance of the strings' ends without load
RADIUS_M, SQUEEZED_M = 0.95e-3, 0.55e-3  # of the pair: not pressed, and pressed as thin as it gets
SQUEEZE_N = 2.0  # side force at which the radius is half way between the two
LEAF_N_PER_M, LEAF_SOFT_M = 5000.0, 0.012  # force: first times bend over (1 + bend/second)
LEAF_SHORTER_PER_M = 46.0  # a bent leaf is shorter by this times the square of the bend
LEAF_IN_N_PER_M = 10e3  # against a force along the leaf
DAMPER_N_S_PER_M, RAIL_N_S_PER_M, SQUEEZE_S = 25.0, 8.0, 0.005
RAIL_FRICTION_N = 0.1
STRING_FRICTION = 0.05  # of the side force: by so much it must change before the pair becomes thinner or thicker


class Plant:
    def __init__(self, step_s, twist_rad):
        self.step_s, self.settled = step_s, False
        self.load_n = 0.5 * GRAVITY
        self.gap_m, self.speed = STRING_M, 0.0
        self.bend_m, self.in_m = 0.0, 0.0  # of a leaf's end
        self.radius_m, self.side_n = RADIUS_M, 0.0  # of the pair, and the side force that it follows

    def step(self, twist_rad):
        # A load that has hung for a while when the rig starts.
        steps, self.settled = (1 if self.settled else round(3.0 / self.step_s)), True
        for _ in range(steps):
            answer = self.move(twist_rad)
        return answer

    def move(self, twist_rad):
        dt, radius, bend = self.step_s, self.radius_m, self.bend_m
        twist = abs(twist_rad)
        # Length across the axis that a string runs, and its derivatives by twist and span. Apart, the strings are straight
        # lines between two circles; from `touch` on they leave the helix of the pair along its tangents.
        length, span = self.gap_m - 2.0 * bend, SPAN_M - 2.0 * self.in_m
        touch = 2.0 * acos(2.0 * radius / span)
        by_span = sin(0.5 * min(twist, touch))
        across = span * by_span + radius * max(twist - touch, 0.0)
        by_twist = radius if twist > touch else 0.5 * span * cos(0.5 * twist)
        string = hypot(length, across)
        stretch = max(string - STRING_M, 0.0)
        tension = STRING_N_PER_M * stretch * (1.0 + stretch / STRING_TOE_M)
        pull, side = 2.0 * tension * length / string, 2.0 * tension * across / string
        # The leaf springs; a force along a bent leaf bends it further.
        inwards = LEAF_IN_N_PER_M * (self.in_m - LEAF_SHORTER_PER_M * bend**2)
        outwards = LEAF_N_PER_M * bend / (1.0 + bend / LEAF_SOFT_M) - 2.0 * LEAF_SHORTER_PER_M * bend * inwards
        self.bend_m += dt * (0.5 * pull - outwards) / DAMPER_N_S_PER_M
        self.in_m += dt * (0.5 * side * by_span - inwards) / DAMPER_N_S_PER_M
        # The pair; squeezing it takes work in proportion to the twist over which the strings touch.
        softest = RADIUS_M - SQUEEZED_M
        self.side_n = min(max(self.side_n, (1.0 - STRING_FRICTION) * side), (1.0 + STRING_FRICTION) * side)
        self.radius_m += dt / SQUEEZE_S * (SQUEEZED_M + softest / (1.0 + self.side_n / SQUEEZE_N) - radius)
        squeezing = SQUEEZE_N * (softest * log(softest / (radius - SQUEEZED_M)) - (RADIUS_M - radius))
        torque = -copysign(side * by_twist + (squeezing if twist > touch else 0.0), twist_rad)
        # The load on its rail.
        mass = self.load_n / GRAVITY
        speed = self.speed + dt * (self.load_n - pull - RAIL_N_S_PER_M * self.speed) / mass
        self.speed = copysign(max(abs(speed) - dt * RAIL_FRICTION_N / mass, 0.0), speed)
        self.gap_m += dt * self.speed
        return f"{self.gap_m!r} {torque!r} {pull!r}"


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
