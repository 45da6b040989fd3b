"""The paper's experiment (its section 5), on an emulated or a real actuator: sweeps under three loads, Fig. 13(a), and
the average transmission ratios.

`python -m tsa_rig.paper_bench --out DIR` runs it on the emulated one; docs/how-to/python.md shows it. It draws with
matplotlib (`pip install "./crates/tsa-python[plot]"`); the published numbers come from the program `tsa-lab`.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from os import fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import RigError, of_kind, wrong
from ._log import read_log
from ._model import STANDARD_GRAVITY, Scene
from ._places import DEFAULT_SCENE, FilePath
from ._rig import Rig
from ._tools import _laboratory

LOADS_KG = (0.1, 0.5, 1.5)
TURNS = 7.5
SPEED_RAD_PER_S = 2.0 * math.pi * 12.5 / 60.0
UNITS = {"contraction": "mm", "average_speed": "mm/s", "average_tr": "rad/mm"}

Row = dict[str, Any]
Values = dict[tuple[str, float, float], float]
"""A quantity, in its unit, by its name, the load (kg) and the turns."""


def _values(load_kg: float, turns: float, contraction_m: float, seconds: float) -> Values:
    millimetres = 1e3 * contraction_m
    found = (millimetres, millimetres / seconds, 2.0 * math.pi * turns / millimetres)
    return {(quantity, load_kg, turns): value for quantity, value in zip(UNITS, found)}


def _published(scene: FilePath) -> tuple[Values, list[Row]]:
    """What the paper prints of its experiment: values, and ratios of two loads as rows."""

    def kilogrammes(newtons: str) -> float:
        return round(float(newtons) / 9.81, 3)  # the paper's gravity

    with tempfile.TemporaryDirectory() as folder:
        _laboratory(scene, ["published", "--out", folder])
        files = [Path(folder, name).read_text(encoding="utf-8") for name in ("published.csv", "ratios.csv")]
    tables = (csv.DictReader(text.splitlines()) for text in files)
    numbers, ratios = ([row for row in table if row["where"] == "Fig. 13"] for table in tables)
    values: Values = {}
    for load_kg, millimetres in ((kilogrammes(row["load_n"]), float(row["published"])) for row in numbers):
        values["contraction", load_kg, TURNS] = millimetres
        values["average_tr", load_kg, TURNS] = 2.0 * math.pi * TURNS / millimetres
    quoted = [
        {
            "quantity": row["quantity"],
            "load_kg": kilogrammes(row["load_n"]),
            "to_load_kg": kilogrammes(row["to_load_n"]),
            "turns": float(row["turns"]),
            "published": float(row["published"]),
        }
        for row in ratios
    ]
    return values, quoted


def _forward(file: Path) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The way up of a recorded sweep: turns past the pre-twist, contraction (m) and time (s) since its begin."""
    log = read_log(file)
    moving = np.flatnonzero(log["state"] == "moving")
    way = moving[: np.argmax(log["twist_rad"][moving]) + 1]
    turns, contraction_m, seconds = (
        np.array(log[name][way], dtype=float) for name in ("twist_rad", "position_m", "t_s")
    )
    # Noise of the encoder, where the motor starts and stops.
    turns = np.maximum.accumulate(turns / (2.0 * np.pi) - 0.5)
    return turns, contraction_m - contraction_m[0], seconds - seconds[0]


def _table(measured: Values, computed: Values, published: Values, quoted: Sequence[Row], source: str) -> list[Row]:
    def row(unit: str, named: Row, *found: float | None) -> Row:
        return {**named, "unit": unit, **dict(zip(("published", "computed", "measured"), found)), "measured_on": source}

    rows = []
    for key, value in measured.items():
        quantity, load_kg, turns = key
        named = {"quantity": quantity, "load_kg": load_kg, "to_load_kg": None, "turns": turns}
        rows.append(row(UNITS[quantity], named, published.get(key), computed[key], value))
    for ratio in quoted:
        one, other = ((ratio["quantity"], ratio[load], ratio["turns"]) for load in ("load_kg", "to_load_kg"))
        if one in measured and other in measured:
            found = (values[one] / values[other] for values in (computed, measured))
            rows.append(row("1", {k: v for k, v in ratio.items() if k != "published"}, ratio["published"], *found))
    return rows


def _markdown(rows: Sequence[Row], about: str) -> str:
    def number(value: float | None) -> str:
        return "–" if value is None or math.isnan(value) else f"{value:.4g}"

    lines = ["# The paper's experiment", "", about, ""]
    lines.append(f"| quantity | load | turns | published | computed | measured ({rows[0]['measured_on']}) |")
    lines.append("|---|---|---|---|---|---|")
    for row in rows:
        quantity = row["quantity"].replace("_", " ").replace(" tr", " TR")
        to = row["to_load_kg"]
        load = f"{row['load_kg']:g} kg" + ("" if to is None else f" / {to:g} kg")
        name = f"{quantity} ({row['unit']})" if to is None else f"ratio of {quantity}"
        found = " | ".join(number(row[key]) for key in ("published", "computed", "measured"))
        lines.append(f"| {name} | {load} | {row['turns']:g} | {found} |")
    return "\n".join(lines) + "\n"


def run(
    rig: Rig,
    out: FilePath,
    *,
    turns: float = TURNS,
    speed_rad_per_s: float = SPEED_RAD_PER_S,
    ask: Callable[[str], object] = input,
    say: Callable[[str], object] = print,
) -> list[Row]:
    """Homes and sweeps (`Rig.sweep`) under 0.1, 0.5 and 1.5 kg, and writes into the folder `out`: `sweep-0.1kg.csv` and
    the two others for `identify`, `fig13.png` (contraction over turns), `ratios.csv`, and the same as `ratios.md`.

    The load of an emulated rig is changed; on a real one `ask` is called with what the operator shall hang, and returns
    when it hangs. `turns` are past the half-turn pre-twist, the speed is the strings' (rad/s; the paper's 12.5 rpm
    without one). `say` is told of each file.

    Returns the rows of `ratios.csv`, at half of the turns and at all of them. Contraction (mm), average speed (mm/s)
    and average TR (rad of the strings per mm) are of the way up from its begin, `published` is None where the paper
    prints nothing, `computed` is by the rig's scene, NaN where its model refuses the state. With `to_load_kg` a row is
    the ratio of two loads. `measured_on` is `emulated` or `real`.

    Raises MissingFileError if `tsa-lab` is not there, and OperationError if matplotlib is missing, both before anything
    moves; ArgumentError and OperationError as `Rig.sweep`.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise of_kind("failed", "paper_bench draws with matplotlib: pip install matplotlib") from None
    if not 0.0 < speed_rad_per_s < math.inf:
        raise wrong(f"speed_rad_per_s {speed_rad_per_s} must be above 0")
    published, quoted = _published(rig.scene)
    mechanism = Scene.load(rig.scene).mechanism()
    emulated = rig.status()["rig"]
    source = "real" if emulated is None else "emulated"
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(8.0, 5.0))
    axes = figure.subplots()
    measured: Values = {}
    computed: Values = {}
    for load_kg in LOADS_KG:
        if emulated is None:
            ask(f"Hang {load_kg} kg (add to what hangs, take nothing off), then press Enter: ")
        load_n, file = load_kg * STANDARD_GRAVITY, folder / f"sweep-{load_kg}kg.csv"
        rig.sweep(load_n, file, turns, speed_rad_per_s)
        say(f"{file}: {source}")
        up, contraction_m, seconds = _forward(file)
        at = np.linspace(0.0, turns, 101)
        model_m = mechanism.solve(load_n, at).contraction_m
        for place in (turns / 2.0, turns):
            found = (float(np.interp(place, up, values)) for values in (contraction_m, seconds))
            measured |= _values(load_kg, place, *found)
            model = float(np.interp(place, at, model_m))
            computed |= _values(load_kg, place, model, 2.0 * math.pi * place / speed_rad_per_s)
        (line,) = axes.plot(up, 1e3 * contraction_m, ".", markersize=2, label=f"{load_kg} kg, measured ({source})")
        axes.plot(at, 1e3 * model_m, color=line.get_color(), label=f"{load_kg} kg, computed")
        if ("contraction", load_kg, turns) in published:
            axes.plot(turns, published["contraction", load_kg, turns], "x", color=line.get_color())
    rows = _table(measured, computed, published, quoted, source)
    with (folder / "ratios.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    what = "A real actuator" if emulated is None else f"An emulated actuator ({emulated} plant), not a real one"
    about = (
        f"{what}, beside the paper's numbers and those computed by {fspath(rig.scene)}: of the way up from its begin, "
        f"at {speed_rad_per_s:.4g} rad/s of the strings. The published average TR follows from the published "
        "contraction."
    )
    (folder / "ratios.md").write_text(_markdown(rows, about), encoding="utf-8")
    axes.set(xlabel="turns of the strings past the pre-twist", ylabel="contraction (mm)", title=what)
    axes.legend(title="x: published")
    figure.savefig(folder / "fig13.png", dpi=120)
    say(f"{folder / 'ratios.md'}, fig13.png, ratios.csv")
    return rows


def main(words: Sequence[str] | None = None) -> int:
    """The command. Returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tsa_rig.paper_bench", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--out", required=True, metavar="DIR", help="folder to write")
    parser.add_argument("--port", default="sim", help="sim (emulated), auto, or a serial device [default: sim]")
    parser.add_argument("--scene", default=DEFAULT_SCENE, metavar="FILE", help=f"[default: {DEFAULT_SCENE}]")
    parser.add_argument("--rig", metavar="ideal|nominal|hard", help="emulated plant [default: nominal]")
    parser.add_argument("--seed", type=int, help="seed of the emulated plant [default: 1]")
    options = vars(parser.parse_args(words))
    of_plant = {key: options[key] for key in ("rig", "seed") if options[key] is not None}
    if of_plant and options["port"] != "sim":
        parser.error(f"--{next(iter(of_plant))} is of an emulated rig, not of --port {options['port']}")
    try:
        with Rig(options["port"], scene=options["scene"], **of_plant) as rig:
            run(rig, options["out"])
    except (RigError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
