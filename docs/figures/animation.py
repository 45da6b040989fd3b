"""Draws animation.svg: the mechanism under a light and a heavy load, twisted by the same turns.

    cargo xtask build
    python3 docs/figures/animation.py

`rigctl solve --batch` computes every state from `scenes/default.toml`; another `rigctl` can be named as the argument.
Between the states the SVG interpolates. Needs Python 3.11 and nothing else.
"""

import json
import math
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
G = 9.80665  # m/s²
LOADS_KG = (0.1, 1.5)
TURNS = 4
UP, DOWN = 12, 4  # drawn states per turn, while twisting and while untwisting
TIMES_S = (0.8, 5.0, 2.2, 1.6)  # rest, twist, rest, untwist
WIDTH, HEIGHT, TOP = 820, 580, 106
SCALE = 3700.0  # px/m
AXES = (110, 520)  # px, of the two mechanisms
SEGMENTS = 2 * (2 * TURNS + 1)  # Bézier curves of one twisted string

ROD, STRINGS, GREY = "#1b6e3c", ("#2a5a9e", "#b35900"), "#bbb"


def states(rigctl: str, scene: Path) -> list[list[dict[str, float]]]:
    """Equilibria of each load while the strings are twisted, from the full solver."""
    steps = [k / UP for k in range(UP * TURNS + 1)]
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as rows:
        rows.write("load_n,turns\n")
        rows.writelines(f"{load * G},{turns}\n" for load in LOADS_KG for turns in steps)
        rows.flush()
        command = [rigctl, "solve", "--batch", rows.name, "--json", "--scene", str(scene)]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    solved = [json.loads(line) for line in lines]
    return [solved[: len(steps)], solved[len(steps) :]]


def rod(state: dict[str, float], scene: dict, points: int = 6) -> list[tuple[float, float]]:
    """Half a rod of linear material (m): along the unbent rod and sideways, integrated from the clamp to the tip."""
    geometry, modulus = scene["geometry"], scene["material"]["stress_coefficients_pa"]
    assert not any(modulus[1:]), "the drawing integrates rods of linear material only"
    radius = geometry["rod_radius_m"]
    area, inertia = math.pi * radius**2, math.pi * radius**4 / 4
    inwards, sideways = 0.5 * state["load_n"] * math.tan(state["alpha_rad"]), 0.5 * state["load_n"]
    half_clamp = 0.5 * geometry["clamp_width_m"]

    def slope(y: tuple[float, ...]) -> tuple[float, ...]:
        angle, curvature = y[2], y[3]
        stretch = 1 + (sideways * math.sin(angle) - inwards * math.cos(angle)) / (area * modulus[0])
        moment = -stretch * (inwards * math.sin(angle) + sideways * math.cos(angle))
        return (stretch * math.cos(angle), stretch * math.sin(angle), curvature, moment / (modulus[0] * inertia))

    y = (half_clamp, 0.0, 0.0, state["bending_strain"] / radius)
    path, each = [y[:2]], 20
    step = 0.5 * (geometry["rod_span_m"] - geometry["clamp_width_m"]) / (each * points)
    for k in range(each * points):
        middle = tuple(a + 0.5 * step * b for a, b in zip(y, slope(y)))
        y = tuple(a + step * b for a, b in zip(y, slope(middle)))
        if (k + 1) % each == 0:
            path.append(y[:2])
    error = math.hypot(y[0] - 0.5 * state["D_m"], y[1] - state["w_m"])
    assert error < 2e-6, f"the drawn rod ends {error} m from where the solver has it"
    return path


def px(value_m: float) -> int:
    """Tenths of a pixel, which keep the file small."""
    return round(10 * SCALE * value_m)


def line(points: list[tuple[float, float]]) -> str:
    return "M" + " ".join(f"{px(x)} {px(y)}" for x, y in points)


def rod_path(half: list[tuple[float, float]], seen: float = 1.0, way: float = 1.0) -> str:
    """Both halves of a rod; `seen` is the cosine of its angle to the plane of the drawing."""
    both = [(-x, w) for x, w in reversed(half)] + half
    return line([(seen * x, way * w) for x, w in both])


def string_path(state: dict[str, float], side: float) -> str:
    """A string in the plane of the drawing, from the turning upper rod to the lower one that does not turn."""
    twist = math.pi + 2 * math.pi * state["turns"]
    lead = 0.5 * state["D_m"] / math.tan(state["alpha_rad"])
    start, length, radius = state["w_m"] + lead, state["X_m"] - 2 * lead, state["r_m"]
    step = 1 / SEGMENTS

    def at(share: float) -> tuple[float, float]:
        return side * radius * math.cos(twist * (1 - share)), start + share * length

    def third(share: float) -> tuple[float, float]:
        return side * radius * twist * math.sin(twist * (1 - share)) * step / 3, length * step / 3

    path = line([(side * 0.5 * state["D_m"] * math.cos(twist), state["w_m"]), at(0)]) + "C"
    for k in range(SEGMENTS):
        (x0, y0), (u0, v0), (x1, y1), (u1, v1) = (
            at(k * step),
            third(k * step),
            at((k + 1) * step),
            third((k + 1) * step),
        )
        path += " ".join(f"{px(x)} {px(y)}" for x, y in ((x0 + u0, y0 + v0), (x1 - u1, y1 - v1), (x1, y1))) + " "
    return path + f"L{px(side * 0.5 * state['D_m'])} {px(state['w_m'] + state['X_m'])}"


def times(every: int = 1) -> tuple[list[int], list[float]]:
    """Which state is drawn when: its index and the fraction of the whole duration."""
    rest, up, hold, down = TIMES_S
    last, total = UP * TURNS, sum(TIMES_S)
    rising = [(k, rest + up * k / last) for k in range(0, last + 1, every)]
    back = max(every, UP // DOWN)
    falling = [(k, rest + up + hold + down * (last - k) / last) for k in range(last, -1, -back)]
    frames = [(0, 0.0), *rising, *falling]
    return [k for k, _ in frames], [t / total for _, t in frames]


def animated(attribute: str, values: list[str], every: int = 1) -> str:
    """An endless animation through the values, one for each state."""
    index, at = times(every)
    keys = ";".join(f"{t:.4g}" for t in at)
    kind = "animateTransform" if attribute in ("translate", "rotate") else "animate"
    name = f'transform" type="{attribute}' if kind == "animateTransform" else attribute
    listed = ";".join(values[k] for k in index)
    duration = f"{sum(TIMES_S):g}s"
    return f'<{kind} attributeName="{name}" dur="{duration}" repeatCount="indefinite" keyTimes="{keys}" values="{listed}"/>'


def counter(x: float, y: float, style: str, texts: list[str]) -> str:
    """A text that follows the states in quarters of a turn. Without animation the last one shows."""
    every, found = UP // 4, ""
    shown = [k for k in range(0, len(texts), every)]
    index, at = times(every)
    for k in shown:
        keys, values = [0.0], [int(index[0] == k)]
        for j, (i, t) in enumerate(zip(index, at)):
            if int(i == k) != values[-1]:
                keys.append(t)
                values.append(int(i == k))
        anchor = 1 if k == shown[-1] else 0
        found += (
            f'<text x="{x}" y="{y}" class="{style}" opacity="{anchor}">{texts[k]}<animate attributeName="opacity" '
            f'calcMode="discrete" dur="{sum(TIMES_S):g}s" repeatCount="indefinite" keyTimes="{";".join(f"{t:.4g}" for t in keys)}" '
            f'values="{";".join(map(str, values))}"/></text>\n'
        )
    return found


def weight(load_kg: float) -> str:
    """A weight below the clamp; its size grows with the cube root of its mass."""
    size = 62 * (load_kg / max(LOADS_KG)) ** (1 / 3)
    return f'<path d="M0,0V16" class="w"/><rect x="{-size / 2:.1f}" y="16" width="{size:.1f}" height="{size:.1f}" rx="4" class="f"/>'


def mechanism(axis: float, load_kg: float, solved: list[dict[str, float]], scene: dict) -> str:
    """One mechanism that hangs from its motor, with its start in grey, and a ruler of the lift."""
    halves = [rod(state, scene) for state in solved]
    cosines = [math.cos(math.pi + 2 * math.pi * state["turns"]) for state in solved]
    gaps = [SCALE * (state["w_m"] * 2 + state["X_m"]) for state in solved]
    first, last = solved[0], solved[-1]
    lift = [1e3 * state["contraction_m"] for state in solved]
    upper = [rod_path(half, seen) for half, seen in zip(halves, cosines)]
    lower = [rod_path(half, way=-1) for half in halves]
    thick = 10 * SCALE * 2 * scene["geometry"]["rod_radius_m"]
    clamp = 500 * scene["geometry"]["clamp_width_m"] * SCALE / 1e3

    svg = f'<g transform="translate({axis} {TOP})">\n'
    svg += '<rect x="-34" y="-46" width="68" height="40" rx="4" class="f"/><text y="-21" class="n m">motor</text><path d="M0,-6V0" class="w"/>\n'
    # Where the load hangs before the motor turns.
    svg += f'<g transform="scale(.1)" class="l" stroke="{GREY}"><path stroke-width="12" d="{string_path(first, 1)}"/>'
    svg += f'<path stroke-width="12" d="{string_path(first, -1)}"/><path stroke-width="{thick:.0f}" d="{rod_path(halves[0])}"/></g>\n'
    svg += f'<g transform="translate(0 {gaps[0]:.1f})"><path transform="scale(.1)" class="l" stroke="{GREY}" stroke-width="{thick:.0f}" d="{lower[0]}"/></g>\n'
    # A ruler from there upwards.
    bottom, ruler = gaps[0], 104
    svg += f'<path class="w" d="M{ruler},{bottom:.1f}V{bottom - 15e-3 * SCALE:.1f}"/>'
    for mm in range(0, 16, 5):
        y = bottom - mm * 1e-3 * SCALE
        svg += f'<path class="w" d="M{ruler},{y:.1f}h8"/><text x="{ruler + 13}" y="{y + 5:.1f}" class="n">{mm}{" mm" if mm == 15 else ""}</text>'
    svg += "\n"
    for side, colour in zip((1, -1), STRINGS):
        paths = [string_path(state, side) for state in solved]
        svg += f'<path transform="scale(.1)" class="l" stroke="{colour}" stroke-width="26" d="{paths[-1]}">{animated("d", paths)}</path>\n'
    svg += f'<path transform="scale(.1)" class="l" stroke="{ROD}" stroke-width="{thick:.0f}" d="{upper[-1]}">{animated("d", upper)}</path>'
    svg += f'<rect x="{-clamp:.1f}" y="-4" width="{2 * clamp:.1f}" height="8" fill="{ROD}"/>\n'
    moves = animated("translate", [f"0 {gap:.1f}" for gap in gaps])
    svg += f'<g transform="translate(0 {gaps[-1]:.1f})">{moves}<path transform="scale(.1)" class="l" stroke="{ROD}" '
    svg += f'stroke-width="{thick:.0f}" d="{lower[-1]}">{animated("d", lower, UP)}</path>'
    svg += f'<rect x="{-clamp:.1f}" y="-4" width="{2 * clamp:.1f}" height="8" fill="{ROD}"/>{weight(load_kg)}'
    svg += f'<path class="r" d="M{clamp + 4:.1f},0H{ruler - 2}"/></g>\n'
    # What is read off.
    lines = ["rods bent inwards by", f"{1e3 * last['w_m']:.1f} mm, strings", f"{1e3 * last['D_m']:.1f} mm apart there"]
    svg += f'<text x="90" y="60" class="b">{load_kg:g} kg</text>'
    svg += "".join(f'<text x="90" y="{82 + 19 * k}" class="n">{text}</text>' for k, text in enumerate(lines))
    svg += (
        f'\n<text x="90" y="164" class="n">lift</text>{counter(130, 164, "c", [f"{value:.1f} mm" for value in lift])}'
    )
    ratios = [f"{1e-3 * state['tr_rad_per_m']:.2f} rad/mm" for state in solved]
    svg += f'<text x="90" y="192" class="n">TR</text>{counter(130, 192, "c", ratios)}</g>\n'
    return svg


def main() -> None:
    rigctl = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/rigctl")
    file = ROOT / "scenes/default.toml"
    scene = tomllib.loads(file.read_text())
    both = states(rigctl, file)
    light, heavy = (1e3 * solved[-1]["contraction_m"] for solved in both)
    title = "The same turns lift a light load fast and a heavy load slowly"
    middle = 0.5 * sum(AXES)
    svg = f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img">
<title>{title}</title>
<desc>Two twisted-string mechanisms, computed and to scale: {TURNS} turns lift {LOADS_KG[0]} kg by {light:.1f} mm and {LOADS_KG[1]} kg by {heavy:.1f} mm.</desc>
<style>text{{font:15px "DejaVu Sans",Verdana,sans-serif;fill:#111}}.b{{font-weight:bold;font-size:17px}}.h{{font-size:18px;font-weight:bold}}.n{{fill:#555}}.m{{text-anchor:middle}}.c{{font-weight:bold;font-size:17px}}.f{{fill:#f3f3ee;stroke:#111;stroke-width:1.5}}.w{{fill:none;stroke:#111;stroke-width:1.6}}.r{{fill:none;stroke:#b3261e;stroke-width:1.6}}.l{{fill:none;stroke-linejoin:round}}</style>
<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>
<text x="24" y="32" class="h">{title}</text>
"""
    svg += f'<text x="{middle - 28:.0f}" y="{TOP - 20}" class="n" text-anchor="end">string turns</text>'
    svg += counter(middle - 20, TOP - 20, "c", [f"{state['turns']:.2f}" for state in both[0]])
    hand = animated("rotate", [str(round(360 * state["turns"])) for state in both[0]])
    svg += f'<g transform="translate({middle + 46:.0f} {TOP - 26})"><circle r="17" class="f"/><path class="r" stroke-width="3" d="M0,0V-14">{hand}</path></g>\n'
    for axis, load_kg, solved in zip(AXES, LOADS_KG, both):
        svg += mechanism(axis, load_kg, solved, scene)
    svg += "</svg>\n"
    out = Path(__file__).with_name("animation.svg")
    out.write_text(svg)
    print(
        f"{out.name}: {len(svg.encode()) / 1000:.0f} kB; {LOADS_KG[0]} kg {light:.1f} mm, {LOADS_KG[1]} kg {heavy:.1f} mm"
    )


if __name__ == "__main__":
    main()
