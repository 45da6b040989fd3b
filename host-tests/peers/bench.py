"""The model beside scipy: ``bench.py TSA-LAB OUT.json``, run by ``cargo xtask bench`` at the project's root.

Both run in turns, so that they meet the same machine and load. There are three measures: instructions, the ratio to
scipy, and time. Other load on the machine does not disturb the first and disturbs the last most. Without valgrind the
instructions are missing. The wanted values are shown but not enforced, because a busy machine is not a fault of the
model. A difference between the two solvers is an error. The time and error of scipy over its tolerance go into
out/peers.csv, for ``tsa-lab chart``.
"""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

# The default scene and the scene that is hardest for solvers.
SCENES = ["scenes/default.toml", "scenes/niti-plateau.toml"]
# Largest difference between the tip displacements of scipy and of the model (m).
AGREEMENT_M = 1e-8
# Passes of the two runs of which the difference is taken, so that the instructions of the start cancel.
PASSES = [1, 6]
# Number of turns of the two solvers. A disturbance of some seconds then meets both.
ROUNDS = 5
PEER = Path(__file__).with_name("solve_bvp.py")


def output(*words):
    print(">", *words, file=sys.stderr)
    # The model uses one thread too.
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run(words, env=environment, capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"failed ({run.returncode}): {' '.join(words)}\n{run.stderr}")
    return run


def peer(model, states_file, *options):
    """The model's states, and what scipy makes of the same rods."""
    text = output(*model, "states", SCENES[0]).stdout
    states_file.write_text(text)
    return json.loads(text), json.loads(output(sys.executable, str(PEER), *options, str(states_file)).stdout)


def one_round(model, states_file):
    """One turn of both solvers: times (µs) of the model, times and differences of scipy, and their ratios."""
    states, found = peer(model, states_file)
    us = states["us_per_equilibrium"]
    ratio = {solver: found[solver]["ms_per_rod"] * 1e3 / us for solver in ("solve_bvp", "shooting")}
    return {"us_per_equilibrium": us, "us_per_rod": states["us_per_rod"], "ratio": ratio, "peer": found}


def sweep(model, states_file):
    """Writes the error and time of scipy over its tolerance."""
    states, points = peer(model, states_file, "--repeats", "3", "--sweep")
    Path("out").mkdir(exist_ok=True)
    with open("out/peers.csv", "w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["solver", "tolerance", "error_m", "us", "failed"])
        rows.writerow(["first-integral, rod", "", "", f"{states['us_per_rod']:.3f}", 0])
        rows.writerow(["first-integral, equilibrium", "", "", f"{states['us_per_equilibrium']:.3f}", 0])
        for p in points:
            us = "" if p["us"] is None else f"{p['us']:.3f}"
            rows.writerow([p["solver"], p["tolerance"], p["error_m"], us, p["failed"]])


def instructions(model, scene):
    """Instructions per equilibrium, as callgrind counts them."""
    counted = []
    for passes in PASSES:
        options = ["--tool=callgrind", "--cache-sim=no", "--callgrind-out-file=/dev/null"]
        run = output("valgrind", *options, *model, "kernel", scene, str(passes))
        counted.append((int(re.search(r"Collected : (\d+)", run.stderr)[1]), int(run.stdout)))
    (few, few_states), (many, many_states) = counted
    return (many - few) / (many_states - few_states)


def show(found, difference_m):
    """Prints the tables."""
    default, plateau = found["model"]["scenes"]
    counted = found["instructions_per_equilibrium"] or [None, None]
    rounds = found["rounds_by_ratio"]
    middle = rounds[len(rounds) // 2]
    print(f"{'one thread, medians':<48} {'':>12}  wanted")
    for what, value, digits, wanted in [
        ("default: µs per equilibrium", default["us"], 2, "at most 10"),
        (f"default: s per grid of {default['states']}", default["seconds"], 4, "at most 0.2"),
        ("default: instructions per equilibrium", counted[0], 0, ""),
        ("niti-plateau: µs per equilibrium", plateau["us"], 2, ""),
        ("niti-plateau: instructions per equilibrium", counted[1], 0, ""),
        ("scipy's states: µs per equilibrium", middle["us_per_equilibrium"], 2, ""),
        ("scipy's states: µs per rod alone", middle["us_per_rod"], 2, ""),
        ("scipy solve_bvp: ms per rod", middle["peer"]["solve_bvp"]["ms_per_rod"], 2, ""),
        ("scipy DOP853 shooting: ms per rod", middle["peer"]["shooting"]["ms_per_rod"], 2, ""),
        ("solve_bvp's rod in equilibria of the model", middle["ratio"]["solve_bvp"], 0, "at least 1000"),
        ("  least of the rounds", rounds[0]["ratio"]["solve_bvp"], 0, ""),
        ("  most of the rounds", rounds[-1]["ratio"]["solve_bvp"], 0, ""),
        ("DOP853's rod in equilibria of the model", middle["ratio"]["shooting"], 0, ""),
        ("largest difference of u and w: pm", difference_m * 1e12, 3, "at most 10000"),
    ]:
        print(f"{what:<48} {'–' if value is None else format(value, f'.{digits}f'):>12}  {wanted}")


def main(laboratory, file):
    model = [laboratory, "bench"]
    states_file = Path(file).with_name("states.json")
    rounds = [one_round(model, states_file) for _ in range(ROUNDS)]
    sweep(model, states_file)
    found = {
        "model": json.loads(output(*model, "time", *SCENES).stdout),
        "instructions_per_equilibrium": [instructions(model, s) for s in SCENES] if shutil.which("valgrind") else None,
        "rounds_by_ratio": sorted(rounds, key=lambda r: r["ratio"]["solve_bvp"]),
    }
    peers = [r["peer"][solver] for r in rounds for solver in ("solve_bvp", "shooting")]
    difference_m = max(max(peer["max_du_m"], peer["max_dw_m"]) for peer in peers)
    show(found, difference_m)
    Path(file).write_text(json.dumps(found, indent=2) + "\n")
    print(f"\n{file}")
    if difference_m > AGREEMENT_M:
        sys.exit(f"scipy differs by {difference_m:.1e} m from the model, more than {AGREEMENT_M:.0e} m")


if __name__ == "__main__":
    main(*sys.argv[1:])
