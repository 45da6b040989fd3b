"""Homes three emulated rigs, moves them, and redraws the paper's Fig. 13: contraction over turns, measured and
computed.

Run it in the checkout after `cargo xtask build`, `cargo xtask firmware` and
`pip install ./crates/tsa-python matplotlib`:
python3 crates/tsa-python/examples/fig13.py fig13.png
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import tsa_rig  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
SCENE = ROOT / "scenes" / "default.toml"
LOADS_KG = (0.15, 0.5, 1.5)
TARGET_M = 0.012


def main(out: str) -> None:
    mechanism = tsa_rig.Scene.load(SCENE).mechanism()
    figure, axes = plt.subplots(figsize=(8.0, 5.0))
    for load_kg in LOADS_KG:
        with tsa_rig.Rig("sim", scene=SCENE, rig="nominal", seed=1, plant={"load": f"{load_kg}kg"}) as rig:
            homed = rig.home()
            rig.move(TARGET_M, speed=0.003)
            told = rig.telemetry()
        going = told["state"] == "moving"
        turns = (told["twist_rad"][going] - np.pi) / (2.0 * np.pi)
        (line,) = axes.plot(turns, told["position_m"][going] * 1e3, ".", markersize=2)
        computed = np.linspace(0.0, turns.max(), 60)
        contraction_m = mechanism.solve(homed["load_n"], computed).contraction_m
        label = f"{homed['load_n']:.2f} ± {homed['load_error_n']:.2f} N as weighed"
        axes.plot(computed, contraction_m * 1e3, color=line.get_color(), label=label)
    axes.set(xlabel="turns past the pre-twist", ylabel="contraction (mm)")
    axes.set_title("Emulated nominal rigs: points by the LVDT, lines by the scene")
    axes.legend()
    figure.savefig(out, dpi=120)
    print(out)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "fig13.png")
