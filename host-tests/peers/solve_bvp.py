"""One rod by scipy, as an independent peer of the model: its time and its answer.

Reads what `tsa-lab bench states` prints, writes JSON. The equations are those of the polynomial, extensible rod
(crates/tsa-model/src/rod.rs), but solved along the rod, with none of the first integral that the model stands on:

    N(e, k) = -Px cos(phi) + Py sin(phi)
    phi' = k,  M' = -(1 + e) (Px sin(phi) + Py cos(phi)),  X' = (1 + e) cos(phi),  w' = (1 + e) sin(phi)
    phi(0) = X(0) = w(0) = 0,  M(l) = 0

Lengths are in units of l, k in 1/R, N in A a1, M in A a1 R. Both solvers are given what makes them fast: numbers near
1, section inversion on all points at once, exact Jacobians, the first mesh that costs least, and a secant
that starts from the linear rod.
"""

import argparse
import json
import math
import platform
import statistics
import sys
import time

import numpy
import scipy
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import root_scalar

TOLERANCE = 1e-9
# Of 5 to 301 the number with which the default scene is fastest.
FIRST_NODES = 101
# Exponents of the tolerances of a sweep.
SWEEP = range(-3, -13, -2)


class Section:
    """A round section, normalised by A a1. `b` is k R."""

    def __init__(self, coefficients):
        self.a = [a / coefficients[0] for a in coefficients]

    def forces(self, e, b):
        """N, M and their derivatives by e and b."""
        a1, a2, a3, a4, a5 = self.a
        y = b * b
        stress = e * (a1 + e * (a2 + e * (a3 + e * (a4 + e * a5))))
        tangent = a1 + e * (2 * a2 + e * (3 * a3 + e * (4 * a4 + e * 5 * a5)))
        second = 2 * a2 + e * (6 * a3 + e * (12 * a4 + e * 20 * a5))
        third = 6 * a3 + e * (24 * a4 + e * 60 * a5)
        # Half the fourth derivative of the energy, and its derivatives by e.
        cubic = (a3 + e * (4 * a4 + e * 10 * a5)) / 8
        cubic_e = (4 * a4 + e * 20 * a5) / 8
        quintic = 5 * a5 / 64
        n = stress + y * (second / 8 + y * cubic_e / 4)
        m = b * (tangent / 4 + y * (cubic + y * quintic))
        n_e = tangent + y * (third / 8 + y * 20 * a5 / 32)
        n_b = b * (second / 4 + y * cubic_e)
        m_b = tangent / 4 + y * (3 * cubic + 5 * y * quintic)
        return n, m, n_e, n_b, m_b

    def invert(self, n, m, largest):
        """e, b and the Jacobian where the section carries n and m; `largest` is max() or numpy.max()."""
        e, b = n, 4 * m
        for _ in range(50):
            n_at, m_at, n_e, n_b, m_b = self.forces(e, b)
            r1, r2 = n_at - n, m_at - m
            det = n_e * m_b - n_b * n_b
            de, db = (r1 * m_b - r2 * n_b) / det, (r2 * n_e - r1 * n_b) / det
            e, b = e - de, b - db
            # Newton: the next step would be rounding.
            if largest(abs(de)) < 1e-9 and largest(abs(db)) < 1e-9:
                return e, b, n_e, n_b, m_b
        raise ArithmeticError("the section's inversion does not settle")


class Rod:
    """Half a rod under one tip force."""

    def __init__(self, rods, state):
        self.length = rods["length_m"]
        radius = rods["radius_m"]
        self.slenderness = self.length / radius
        self.section = Section(rods["stress_coefficients_pa"])
        stiffness = math.pi * radius**2 * rods["stress_coefficients_pa"][0]
        self.px, self.py = state["inward_n"] / stiffness, state["sideways_n"] / stiffness

    def by_bvp(self, tolerance=TOLERANCE):
        px, py, s = self.px, self.py, self.slenderness

        def at(y):
            sin, cos = numpy.sin(y[0]), numpy.cos(y[0])
            n = py * sin - px * cos
            across = px * sin + py * cos
            return sin, cos, n, across, self.section.invert(n, y[1], numpy.max)

        def slope(_, y):
            sin, cos, _, across, (e, b, *_) = at(y)
            d = 1 + e
            return numpy.vstack((s * b, -s * d * across, d * cos, d * sin))

        def jacobian(_, y):
            sin, cos, n, across, (e, _, n_e, n_b, m_b) = at(y)
            d = 1 + e
            det = n_e * m_b - n_b * n_b
            # dN/dphi is `across`.
            e_phi, e_m = across * m_b / det, -n_b / det
            b_phi, b_m = -across * n_b / det, n_e / det
            rows = numpy.zeros((4, 4, y.shape[1]))
            rows[0, 0], rows[0, 1] = s * b_phi, s * b_m
            rows[1, 0], rows[1, 1] = -s * (e_phi * across - d * n), -s * e_m * across
            rows[2, 0], rows[2, 1] = e_phi * cos - d * sin, e_m * cos
            rows[3, 0], rows[3, 1] = e_phi * sin + d * cos, e_m * sin
            return rows

        def ends(a, b):
            return numpy.array((a[0], a[2], a[3], b[1]))

        at_clamp, at_tip = numpy.zeros((4, 4)), numpy.zeros((4, 4))
        at_clamp[0, 0] = at_clamp[1, 2] = at_clamp[2, 3] = at_tip[3, 1] = 1

        mesh = numpy.linspace(0, 1, FIRST_NODES)
        straight = numpy.vstack((0 * mesh, 0 * mesh, mesh, 0 * mesh))
        found = solve_bvp(
            slope, ends, mesh, straight, tol=tolerance, fun_jac=jacobian, bc_jac=lambda a, b: (at_clamp, at_tip)
        )
        if not found.success:
            raise ArithmeticError(found.message)
        return self.tip(found.y[:, -1]), found.x.size

    def by_shooting(self, tolerance=TOLERANCE):
        px, py, s = self.px, self.py, self.slenderness
        evaluations = 0

        def slope(_, y):
            sin, cos = math.sin(y[0]), math.cos(y[0])
            e, b, *_ = self.section.invert(py * sin - px * cos, float(y[1]), float)
            d = 1 + e
            return s * b, -s * d * (px * sin + py * cos), d * cos, d * sin

        def shoot(moment):
            nonlocal evaluations
            found = solve_ivp(slope, (0, 1), (0, moment, 0, 0), "DOP853", rtol=tolerance, atol=tolerance * 1e-3)
            if not found.success:
                raise ArithmeticError(found.message)
            evaluations += found.nfev
            return found.y[:, -1]

        def missed(moment):
            return shoot(moment)[1]

        # Clamp moment of a straight rod, and of one deflected by so much as a linear one would be.
        flat = s * py
        bent = flat + s * px * min(1.0, 4 * s * s * py / 3)
        tight = {"xtol": 1e-14, "rtol": 1e-10}
        found = root_scalar(missed, x0=flat, x1=bent, method="secant", **tight)
        if not found.converged:
            found = root_scalar(missed, bracket=(0, 1.1 * s * (px + py)), method="brentq", **tight)
        return self.tip(shoot(found.root)), evaluations

    def tip(self, y):
        """u and w (m)."""
        return (y[2] - 1) * self.length, y[3] * self.length


def measure(rods, solve, repeats):
    """Median time over the states of the median over the repeats, and the largest difference from the model."""
    times, du, dw, effort = [], 0.0, 0.0, []
    for state in rods["states"]:
        rod = Rod(rods, state)
        (u, w), steps = solve(rod)
        if not (math.isfinite(u) and math.isfinite(w)):
            raise ArithmeticError("a tip that is no number")
        du, dw = max(du, abs(u - state["u_m"])), max(dw, abs(w - state["w_m"]))
        effort.append(steps)
        laps = []
        for _ in range(repeats):
            before = time.perf_counter()
            solve(rod)
            laps.append(time.perf_counter() - before)
        times.append(statistics.median(laps))
    return {
        "ms_per_rod": statistics.median(times) * 1e3,
        "ms_least": min(times) * 1e3,
        "ms_most": max(times) * 1e3,
        "max_du_m": du,
        "max_dw_m": dw,
        "median_effort": statistics.median(effort),
    }


def sweep(rods, repeats):
    """Time and error over the tolerance. A rod without an answer counts as failed and not in the error."""
    points = []
    for name, solver in ("solve_bvp", Rod.by_bvp), ("DOP853 shooting", Rod.by_shooting):
        for exponent in SWEEP:
            tolerance = 10.0**exponent
            times, error, failed = [], 0.0, 0
            for state in rods["states"]:
                rod = Rod(rods, state)
                laps = []
                try:
                    for _ in range(repeats):
                        before = time.perf_counter()
                        (u, w), _ = solver(rod, tolerance)
                        laps.append(time.perf_counter() - before)
                except ArithmeticError:
                    failed += 1
                    continue
                error = max(error, abs(u - state["u_m"]), abs(w - state["w_m"]))
                times.append(statistics.median(laps))
            points.append(
                {
                    "solver": name,
                    "tolerance": tolerance,
                    "us": statistics.median(times) * 1e6 if times else None,
                    "error_m": error,
                    "failed": failed,
                }
            )
    return points


def main():
    parser = argparse.ArgumentParser(description="One rod by scipy: time, and difference from the model's answer")
    parser.add_argument("states", help="what `tsa-lab bench states` printed")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--sweep", action="store_true", help="over the tolerance, instead of at one")
    arguments = parser.parse_args()
    with open(arguments.states) as file:
        rods = json.load(file)
    if arguments.sweep:
        json.dump(sweep(rods, arguments.repeats), sys.stdout, indent=2)
        print()
        return
    found = {
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "tolerance": TOLERANCE,
        "rods": len(rods["states"]),
        # Effort: nodes of the last mesh; evaluations of the right-hand side.
        "solve_bvp": measure(rods, Rod.by_bvp, arguments.repeats),
        "shooting": measure(rods, Rod.by_shooting, arguments.repeats),
    }
    json.dump(found, sys.stdout, indent=2)
    print()


if __name__ == "__main__":
    main()
