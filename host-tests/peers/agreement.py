"""The study of how `tsa_rig.Bench` agrees with the ELF on the emulated board, as JSON: both home and move the same
plants, and `Bench` does so once more a little later, which shows what other samples of the same noise change.

Needs `tsa_rig`, and tools and firmware built: `cargo xtask results agreement`.
"""

import json
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import tsa_rig

KINDS = ("ideal", "nominal", "hard")
# Nothing was tuned on them.
SEEDS = range(91001, 91011)
LOADS = ("0.1kg", "0.5kg", "1.5kg")
TARGETS_M = (0.008, 0.004, 0.011)
# By how much the host link delays the homing, in ticks.
LATER = 3
# What is compared, its unit, how many of it are one of SI, and digits after the point.
COMPARED = (
    ("homed load", "mN", 1e3, 1),
    ("true position reached", "µm", 1e6, 1),
    ("duration of a move", "s", 1.0, 2),
)


def by_bench(kind, load, ticks):
    """The three, by homing or move and seed, NaN where it failed; and why, by seed."""
    bench = tsa_rig.Bench(rig=kind, seeds=SEEDS, plant={"load": load})
    while ticks and (bench.telemetry()["state"] == "boot").any():
        bench.step()
    if ticks:
        bench.step(ticks)
    homed = bench.home()
    moves = [bench.move(target_m) for target_m in TARGETS_M]
    why = [next(filter(None, errors), "") for errors in zip(*(done["error"] for done in [homed, *moves]))]
    positions, durations = (np.array([moved[key] for moved in moves]) for key in ("true_error_m", "duration_s"))
    return [np.array([homed["load_n"]]), positions, durations], why


def by_board(kind, load, seed):
    """The same of one seed."""
    found, why = [np.full(n, np.nan) for n in (1, len(TARGETS_M), len(TARGETS_M))], ""
    try:
        with tsa_rig.Rig("sim", rig=kind, seed=seed, plant={"load": load}) as rig:
            found[0][0] = rig.home()["load_n"]
            for k, target_m in enumerate(TARGETS_M):
                moved = rig.move(target_m)
                found[1][k], found[2][k] = moved["true_error_m"], moved["duration_s"]
    except tsa_rig.RigError as error:
        why = str(error)
    return found, why


def main():
    head = ["plants", "difference in", "compared", "`Bench` and ELF: median; maximum", "`Bench` and itself later"]
    study = {"values": {}, "table": [head], "notes": []}
    failures = []
    for kind in KINDS:
        differences = [([], []) for _ in COMPARED]
        for load in LOADS:
            bench, later = (by_bench(kind, load, ticks) for ticks in (0, LATER))
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                boards = list(pool.map(lambda seed: by_board(kind, load, seed), SEEDS))
            for k, kept in enumerate(differences):
                board = np.array([found[k] for found, _ in boards]).T
                for other, of_other in zip((board, later[0][k]), kept):
                    of_other.extend(np.abs(other - bench[0][k]).ravel())
            whys = zip(SEEDS, bench[1], (why for _, why in boards))
            failures += [(kind, load, *of_seed) for of_seed in whys if any(of_seed[1:])]
        for (name, unit, factor, digits), kept in zip(COMPARED, differences):
            known = [factor * np.array(values)[np.isfinite(values)] for values in kept]
            cells = [f"{np.median(values):.{digits}f}; {values.max():.{digits}f} {unit}" for values in known]
            study["table"].append([kind, name, f"{len(known[0])} of {len(kept[0])}", *cells])
    failed = [sum(bool(failure[k]) for failure in failures) for k in (3, 4)]
    study["notes"].append(
        f"{len(KINDS) * len(LOADS) * len(SEEDS)} homings, each with {len(TARGETS_M)} moves: {failed[0]} of them failed "
        f"with `Bench`, {failed[1]} with the ELF."
    )
    for kind, load, seed, *why in failures:
        of_both = "; ".join(f"{what}: {text or 'it did not fail'}" for what, text in zip(("`Bench`", "ELF"), why))
        study["notes"].append(f"Failed: {kind} plant, seed {seed}, {load}. {of_both}.")
    print(json.dumps(study))


if __name__ == "__main__":
    main()
