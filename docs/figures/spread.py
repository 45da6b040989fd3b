"""Draws spread.svg: how errors scatter over emulated plants, from charts/rigs.csv, which `cargo xtask results rigs` writes.

    python3 docs/figures/spread.py

Needs Python 3.11 and nothing else.
"""

import csv
import math
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
COLOURS = {"ideal": "#1b6e3c", "nominal": "#2a5a9e", "hard": "#b35900"}
# What the file calls it; the panel's title; factor to its unit; ends of the axis.
PANELS = [
    ("rest_true_m", "true position error at rest (µm)", 1e6, (5, 2000)),
    ("following_most_m", "largest tracking error in a move (µm)", 1e6, (20, 8000)),
    ("load_after_homing", "load error after homing (%)", 100, (0.01, 100)),
    ("load_after_step", "load error after a load step (%)", 100, (0.01, 100)),
]
UNITS = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "%": 1e-2}
WIDTH, HEIGHT = 1100, 640
STYLE = (
    'text{font:16px "DejaVu Sans",Verdana,sans-serif;fill:#111}.b{font-weight:bold}.h{font-size:20px;font-weight:bold}'
    ".n{fill:#555}.m{text-anchor:middle}.e{text-anchor:end}.g{stroke:#ddd}.a{stroke:#111;stroke-width:1.5}"
)


def limit(text: str) -> float:
    """An acceptance limit such as "0.15 mm" or "5 % + 0.05 N", of which the first part is drawn."""
    number, unit = text.split()[:2]
    return float(number) * UNITS[unit]


def main() -> None:
    with open(DOCS / "charts/rigs.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if not row["effect"] and row["table"] == "identified"]
    cases = {row["rig"]: row["cases"] for row in rows if row["check"] == "rest_true_m"}
    title = "Errors over many calibrated plants, and the limits they should meet"
    note = "Emulated; constants identified on the same plant. Cases (a plant under one of four loads): " + ", ".join(
        f"{kind} {count}" for kind, count in cases.items()
    )
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img">\n'
        f"<title>{title}</title>\n<desc>{note}</desc>\n<style>{STYLE}</style>\n"
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>\n<text x="24" y="34" class="h">{title}</text>\n'
        f'<text x="24" y="60" class="n">{note}</text>\n'
    )
    for number, (check, name, factor, (low, high)) in enumerate(PANELS):
        left, top = 110 + 520 * (number % 2), 112 + 230 * (number // 2)
        right, bottom = left + 420, top + 140

        def x(value: float) -> float:
            return left + (right - left) * math.log(max(value, low) / low) / math.log(high / low)

        svg += f'<text x="{left}" y="{top - 10}" class="b">{name}</text>\n'
        for power in range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1):
            at = x(10**power)
            svg += f'<path class="g" d="M{at:.1f},{top}V{bottom}"/><text x="{at:.1f}" y="{bottom + 22}" class="n m">{10**power:g}</text>\n'
        svg += f'<path class="a" d="M{left},{bottom}H{right}"/>\n'
        for line, kind in enumerate(COLOURS):
            row = next(row for row in rows if row["rig"] == kind and row["check"] == check)
            median, most, worst = (x(factor * float(row[key])) for key in ("median", "p95", "worst"))
            y, colour, bound = top + 30 + 42 * line, COLOURS[kind], x(factor * limit(row["floor"]))
            svg += f'<text x="{left - 10}" y="{y + 5}" class="e">{kind}</text>'
            svg += f'<path stroke="{colour}" stroke-width="1.6" d="M{median:.1f},{y}H{worst:.1f}m0,-5v10"/>'
            svg += f'<path stroke="{colour}" stroke-width="7" d="M{median:.1f},{y}H{most:.1f}"/>'
            svg += f'<circle cx="{median:.1f}" cy="{y}" r="7" fill="{colour}"/>'
            svg += f'<path stroke="#b3261e" stroke-width="2.5" d="M{bound:.1f},{y - 14}v28"/>\n'
    y = 570
    svg += f'<circle cx="120" cy="{y}" r="7" fill="#555"/><text x="136" y="{y + 5}">median</text>'
    svg += (
        f'<path stroke="#555" stroke-width="7" d="M240,{y}h40"/><text x="290" y="{y + 5}">to the 95th percentile</text>'
    )
    svg += (
        f'<path stroke="#555" stroke-width="1.6" d="M520,{y}h40m0,-5v10"/><text x="572" y="{y + 5}">to the worst</text>'
    )
    svg += f'<path stroke="#b3261e" stroke-width="2.5" d="M730,{y - 14}v28"/><text x="742" y="{y + 5}">acceptance limit</text>\n'
    svg += f'<text x="110" y="{y + 36}" class="n">All axes are logarithmic. Of a limit such as 5 % + 0.05 N the first part is drawn.</text>\n</svg>\n'
    Path(__file__).with_name("spread.svg").write_text(svg)


if __name__ == "__main__":
    main()
