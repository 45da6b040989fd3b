"""The study of a new rig's calibration, as JSON: the six commands of docs/how-to/calibrate.md on emulated rigs, and
contractions and a move before and after them. It calls the tool, as a user does; tool and firmware must be built. Needs nothing but
Python's own library.
"""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path

# The rigs: a name, and the tool's words for it.
RIGS = {
    "nominal": ["--rig", "nominal", "--seed", "7"],
    "hard": ["--rig", "hard", "--seed", "7"],
    "outside": ["--rig", "nominal", "--seed", "7", "--plant-program", "docs/plants/leaf_springs.py"],
}
# Twists (rad) at which the gap is measured for the sensor's points.
TWISTS_RAD = [1.0, 13.0, 19.0, 23.0, 27.0, 30.5, 34.0, 37.0, 40.0, 43.0, 46.0]
# What callipers resolve (m).
CALLIPERS_M = 0.02e-3
# Loads of the sweeps, and of the moves.
SWEPT = ["1.2N", "4N", "15N"]
MOVED = ["2N", "12N"]
# Loads between those of the sweeps, and turns, at which contractions by the scene are compared with the rig's own.
BETWEEN, TURNS = ["2.2N", "7.7N"], [3.75, 6.5]

HEAD = [
    "rig, load",
    "load: as built",
    "calibrated",
    "position, stated error: as built",
    "calibrated",
    "reported less true position: as built",
    "calibrated",
]


def rigctl(*words):
    """The last object that the tool prints."""
    print("> rigctl", *words, file=sys.stderr)
    run = subprocess.run(["target/release/rigctl", "--json", *words], check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(run.stdout.splitlines()[-1])


def shown(rig, load, twist_rad):
    """What `calibrate lvdt` shows of the rig switched on under a load with its strings at a twist (rad)."""
    return rigctl("calibrate", "lvdt", "--plant", f"load={load},twist_at_boot={twist_rad}", *rig)


def contraction_error(rig, scene):
    """Rms error of a scene's contractions between the loads of the sweeps, as a share of the rig's own."""
    squares = []
    for load in BETWEEN:
        pretwist_m = shown(rig, load, math.pi)["true_gap_m"]
        for turns in TURNS:
            true_m = pretwist_m - shown(rig, load, math.pi + math.tau * turns)["true_gap_m"]
            told = rigctl("--scene", scene, "solve", "--load", load, "--turns", str(turns))
            squares.append((told["contraction_m"] / true_m - 1) ** 2)
    return math.sqrt(sum(squares) / len(squares))


def significant(value):
    """Three significant digits, without an exponent."""
    digits = 0 if value == 0 else max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 12)}f}"


def moved(name, load, before, after):
    """A row: load, and stated and true error of the reported position, of a move before and after."""
    found = (before, after)
    load_n = [f"{f['load_n']:.2f} ± {f['load_error_n']:.2f} N" for f in found]
    stated_m = [f["position_error_m"] for f in found]
    # Both errors count from the target; their difference is the error of the reported position.
    wrong_m = [f["true_error_m"] - f["error_m"] for f in found]
    return [f"{name}, {load}", *load_n, *(f"{1e6 * abs(m):.0f} µm" for m in (*stated_m, *wrong_m))]


def calibrate(name, rig):
    """A rig's rows, and what is said about it."""
    folder = Path("out") / f"calibration-{name}"
    # What an earlier run left is another board's memory.
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    points, flash, scene = (str(folder / file) for file in ("points.csv", "rig.flash", "new.toml"))
    lines = ["gap_m,sensor_m"]
    for twist_rad in TWISTS_RAD:
        found = shown(rig, "0.5kg", twist_rad)
        gap_m = math.floor(found["true_gap_m"] / CALLIPERS_M + 0.5) * CALLIPERS_M
        lines.append(f"{gap_m:.5f},{found['sensor_m']:.6f}")
    Path(points).write_text("\n".join(lines) + "\n")
    memory = ["--flash", flash]
    rigctl("calibrate", "lvdt", "--points", points, *memory, *rig)
    sweeps = [str(folder / f"sweep-{load}.csv") for load in SWEPT]
    for load, file in zip(SWEPT, sweeps):
        rigctl("sweep", "--load", load, "--out", file, *memory, *rig)
    identified = rigctl("identify", *sweeps, "--out", scene, "--figure", f"docs/charts/calibration-{name}.svg")
    known = ["--scene", scene, "--plant-scene", "scenes/default.toml", *memory]
    rigctl(*known, "table", "--board", *rig)
    rows = []
    for load in MOVED:
        move = ["move", "--to", "12mm", "--plant", f"load={load}", *rig]
        rows.append(moved(name, load, rigctl(*move), rigctl(*known, *move)))
    before, after = (significant(100 * contraction_error(rig, s)) for s in ("scenes/default.toml", scene))

    def um(found, key):
        return significant(1e6 * found[key])

    correction, corrected = identified.get("correction"), ""
    if correction:
        corrected = (
            f"The correction leaves {um(correction, 'rms_m')} µm, and {um(correction, 'held_out_m')} µm instead of "
            f"{um(correction, 'held_out_without_m')} µm of blocks held out of one sweep. "
        )
    return rows, (
        f"{name} rig: {identified['chosen']['law']} with {identified['chosen']['material']}, which "
        f"{'holds' if identified['law_holds'] else 'does not hold'}; rms error {um(identified['fitted'], 'rms')} µm over "
        f"{identified['fitted']['count']} equilibria, and {um(identified['held_out'], 'rms')} µm over what was held out. "
        f"{corrected}Contractions under loads between those of the sweeps: {before} % off as built, {after} % calibrated "
        "(rms)."
    )


def main():
    study = {"values": {}, "table": [HEAD], "notes": []}
    for name, rig in RIGS.items():
        rows, note = calibrate(name, rig)
        study["table"] += rows
        study["notes"].append(note)
    print(json.dumps(study))


if __name__ == "__main__":
    main()
