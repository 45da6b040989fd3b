"""Draws homing.svg and follow.svg from one recording of the emulated board.

    cargo xtask build && cargo xtask firmware
    python3 docs/figures/recording.py

The same firmware, plant and seed give the same recording. Another `rigctl` can be named as the argument. Needs Python
3.11 and nothing else.
"""

import csv
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLANT = ("nominal", 1)  # kind and seed
MOVES_S = (33.5, 46.5)  # what follow.svg shows
SCRIPT = """
2.5 home load=0.5kg
34  move 8mm speed=2mm/s
40  plant load=0.8kg
43  move 4mm speed=2mm/s
46.6 end
"""
BLUE, ORANGE, GREEN, RED = "#2a5a9e", "#b35900", "#1b6e3c", "#b3261e"
LEFT, RIGHT, WIDTH, HEIGHT = 96, 1076, 1100, 640
STYLE = (
    'text{font:16px "DejaVu Sans",Verdana,sans-serif;fill:#111}.b{font-weight:bold}.h{font-size:20px;font-weight:bold}'
    ".n{fill:#555}.m{text-anchor:middle}.e{text-anchor:end}.g{stroke:#ddd}.a{stroke:#111;stroke-width:1.5}"
    ".l{fill:none;stroke-width:2.2;stroke-linejoin:round}.d{stroke-dasharray:7 5}"
)
Curve = list[tuple[float, float]]


def record(rigctl: str) -> tuple[list[dict[str, str]], dict[str, float], dict[str, float]]:
    """Rows of the log, the times of the events by name, and the result of homing."""
    with tempfile.TemporaryDirectory() as folder:
        script, log = Path(folder, "figure.script"), Path(folder, "figure.csv")
        script.write_text(SCRIPT)
        kind, seed = PLANT
        options = f"--script {script} --out {log} --rig {kind} --seed {seed}".split()
        subprocess.run([rigctl, "record", *options], check=True, cwd=ROOT, stderr=subprocess.DEVNULL)
        lines = log.read_text().splitlines()
    events, homed = {}, {}
    for words in (line.split(maxsplit=5) for line in lines if line.startswith("# at ")):
        events[" ".join(words[3:5])] = float(words[2])
        if words[4] == "homed":
            homed = json.loads(words[5])
    return list(csv.DictReader(line for line in lines if not line.startswith("#"))), events, homed


def curve(rows: list[dict[str, str]], key: str, scale: float = 1.0) -> Curve:
    return [(float(row["t_s"]), scale * float(row[key])) for row in rows if row[key]]


def gaps(rigctl: str, twist: Curve, load_n: float) -> Curve:
    """The gap less that at the half-turn pre-twist (mm). No telemetry has it before homing has ended."""
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as rows:
        rows.write("load_n,turns\n")
        rows.writelines(f"{load_n},{(angle - math.pi) / (2 * math.pi)}\n" for _, angle in twist)
        rows.flush()
        command = [rigctl, "solve", "--batch", rows.name, "--json", "--scene", str(ROOT / "scenes/default.toml")]
        lines = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    return [(t, -1e3 * json.loads(line)["contraction_m"]) for (t, _), line in zip(twist, lines, strict=True)]


class Figure:
    """Panels one above the other, over the same time."""

    def __init__(self, title: str, note: str, span_s: tuple[float, float]):
        self.span = span_s
        self.svg = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img">\n'
            f"<title>{title}</title>\n<desc>{note}</desc>\n<style>{STYLE}</style>\n"
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>\n<text x="24" y="34" class="h">{title}</text>\n'
            f'<text x="24" y="60" class="n">{note}</text>\n'
        )

    def x(self, t: float) -> float:
        return LEFT + (RIGHT - LEFT) * (t - self.span[0]) / (self.span[1] - self.span[0])

    def panel(self, name: str, top: int, bottom: int, low: float, high: float, ticks: list[float]) -> None:
        self.y = lambda value: bottom + (top - bottom) * (value - low) / (high - low)
        for tick in ticks:
            y = self.y(tick)
            self.svg += f'<path class="g" d="M{LEFT},{y:.1f}H{RIGHT}"/><text x="{LEFT - 8}" y="{y + 5:.1f}" class="n e">{tick:g}</text>\n'
        self.svg += (
            f'<path class="a" d="M{LEFT},{top}V{bottom}"/><text x="{LEFT}" y="{top - 10}" class="b">{name}</text>\n'
        )

    def line(self, points: Curve, colour: str, style: str = "") -> None:
        # More points than pixels say no more.
        every = max(1, len(points) // 500)
        path = " ".join(f"{self.x(t):.1f},{self.y(value):.1f}" for t, value in points[::every])
        self.svg += f'<polyline class="l {style}" stroke="{colour}" points="{path}"/>\n'

    def band(self, upper: Curve, lower: Curve, colour: str) -> None:
        path = " ".join(f"{self.x(t):.1f},{self.y(value):.1f}" for t, value in [*upper[::4], *reversed(lower[::4])])
        self.svg += f'<polygon fill="{colour}" opacity=".22" points="{path}"/>\n'

    def text(self, t: float, value: float, text: str, colour: str = "#111", style: str = "") -> None:
        self.svg += (
            f'<text x="{self.x(t):.1f}" y="{self.y(value):.1f}" class="{style}" style="fill:{colour}">{text}</text>\n'
        )

    def mark(self, t: float, top: int, bottom: int) -> None:
        self.svg += f'<path class="d" stroke="#888" d="M{self.x(t):.1f},{top}V{bottom}"/>\n'

    def write(self, file: str, ticks_s: list[int], zero_s: float, bottom: int) -> None:
        for tick in ticks_s:
            x = self.x(zero_s + tick)
            self.svg += f'<path class="a" d="M{x:.1f},{bottom}v6"/><text x="{x:.1f}" y="{bottom + 24}" class="n m">{tick}</text>\n'
        middle = (LEFT + RIGHT) / 2
        self.svg += f'<path class="a" d="M{LEFT},{bottom}H{RIGHT}"/><text x="{middle}" y="{bottom + 48}" class="m">time (s)</text>\n</svg>\n'
        Path(__file__).with_name(file).write_text(self.svg)


def homing(rigctl: str, rows: list[dict[str, str]], events: dict[str, float], note: str) -> None:
    start, end = events["request home"], events["event homed"]
    rows = [row for row in rows if start <= float(row["t_s"]) <= end]
    twist = curve(rows, "true_twist_rad")
    # A phase ends where the strings turn back, or reach or leave the pre-twist.
    moving = [(t, a) for t, a in twist if t > events["event direction-proven"] and abs(a - twist[0][1]) > 0.02]
    begin = moving[0][0]
    peak = max(moving, key=lambda point: point[1])[0]
    trough = min((point for point in moving if point[0] < start + 6), key=lambda point: point[1])[0]
    lowest = min((point for point in moving if point[0] > trough + 3), key=lambda point: point[1])[0]
    up = max(t for t, a in moving if lowest < t < peak and a < math.pi + 0.02)
    settle = min(t for t, a in moving if t > peak and a < math.pi + 0.02)
    phases = [
        ("direction", "check", start),
        ("probe,", "seek", begin),
        ("centre: across", "zero and back", trough),
        ("to the", "pre-twist", lowest),
        ("six turns up:", "estimate the load", up),
        ("six turns down:", "friction of the rail", peak),
        ("", "settle", settle),
    ]
    assert begin < trough < lowest < up < peak < settle, "the recording has other phases"
    figure = Figure("Homing: zero twist from the gap's maximum, then the load", note, (start, end))
    ends = [phase[2] for phase in phases[1:]] + [end]
    for (first, second, begin_s), end_s in zip(phases, ends):
        middle = (figure.x(begin_s) + figure.x(end_s)) / 2
        narrow = figure.x(end_s) - figure.x(begin_s) < 100
        size = ' style="font-size:14px"' if narrow else ""
        for y, word in ((92, first), (110, second)):
            figure.svg += f'<text x="{middle:.1f}" y="{y}" class="m"{size}>{word}</text>\n'
        if begin_s > start:
            figure.mark(begin_s, 82, 570)
    figure.panel("twist of the strings (rad)", 150, 300, -8, 44, [0, 20, 40])
    figure.line(twist, BLUE)
    figure.panel(
        "gap less that at the pre-twist, by the model for this twist (mm)", 344, 444, -17, 8, [-15, -10, -5, 0]
    )
    figure.line(gaps(rigctl, twist[::5], float(rows[0]["true_load_n"])), ORANGE)
    figure.panel("drive current (A)", 488, 570, -0.07, 0.07, [-0.05, 0, 0.05])
    figure.line(curve(rows, "drive_current_a"), GREEN)
    figure.write("homing.svg", list(range(0, int(end - start) + 1, 5)), start, 570)


def follow(rows: list[dict[str, str]], events: dict[str, float], note: str) -> None:
    first, last = MOVES_S
    rows = [row for row in rows if first <= float(row["t_s"]) <= last]
    figure = Figure("A move, a heavier load, and a move back", note, MOVES_S)
    position = curve(rows, "position_m", 1e3)
    setpoint = curve(rows, "setpoint_m", 1e3)
    changed = next(float(a["t_s"]) for a, b in zip(rows, rows[1:]) if a["true_load_n"] != b["true_load_n"])
    after = [(t, value) for t, value in position if changed < t < changed + 2]
    before = max(value for t, value in setpoint if t < changed)
    fall = min(after, key=lambda point: point[1])
    loads = sorted({float(row["true_load_n"]) / 9.80665 for row in rows})
    requests = [float(a["t_s"]) for a, b in zip(rows, rows[1:]) if a["state"] != "moving" and b["state"] == "moving"]
    for t, word in zip(
        (requests[0], changed, requests[1]),
        ("move to 8 mm", f"load {loads[0]:.1f} → {loads[1]:.1f} kg", "move to 4 mm"),
    ):
        figure.mark(t, 82, 570)
        figure.svg += f'<text x="{figure.x(t) + 6:.1f}" y="94" class="b">{word}</text>\n'
    figure.panel("position (mm)", 134, 270, 0, 9, [0, 4, 8])
    figure.line(position, BLUE)
    figure.line(setpoint, "#111", "d")
    figure.text(36.2, 1.6, "measured", BLUE)
    figure.text(37.6, 1.6, "set-point (dashed)")
    figure.text(fall[0] + 0.25, fall[1] - 0.6, f"falls {before - fall[1]:.1f} mm, returns", BLUE)
    load, error = curve(rows, "load_n"), curve(rows, "load_error_n")
    figure.panel("load (N)", 314, 430, 2, 10.5, [2, 6, 10])
    figure.band(
        [(t, a + b) for (t, a), (_, b) in zip(load, error)], [(t, a - b) for (t, a), (_, b) in zip(load, error)], ORANGE
    )
    figure.line(load, ORANGE)
    figure.line(curve(rows, "true_load_n"), "#111", "d")
    figure.text(35.2, 7.2, "estimated, with its 90 % uncertainty", ORANGE)
    figure.text(35.2, 5.6, "true (dashed)")
    figure.panel("transmission ratio TR (rad of the strings per mm)", 474, 570, 1.5, 6, [2, 4, 6])
    figure.line(curve(rows, "tr_rad_per_m", 1e-3), GREEN)
    figure.write("follow.svg", list(range(0, int(last - requests[0]) + 1, 2)), requests[0], 570)


def main() -> None:
    rigctl = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/rigctl")
    rows, events, homed = record(rigctl)
    plant = f"Emulated board and plant ({PLANT[0]}, seed {PLANT[1]})"
    homing(rigctl, rows, events, f"{plant}; the twist is the plant's, the current the drive's")
    follow(rows, events, f"{plant}; homed with the load given, LVDT not calibrated")
    print(
        f"homed in {events['event homed'] - events['request home']:.1f} s: {homed['load_n']:.2f} ± {homed['load_error_n']:.2f} N"
    )


if __name__ == "__main__":
    main()
