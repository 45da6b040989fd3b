"""The paper's experiment as one command, on the emulated rig."""

import csv
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tsa_rig
from tsa_rig import paper_bench

ROOT = Path(__file__).resolve().parents[3]
PROGRAMS = os.environ.get("TSA_PROGRAMS")
SCENE = ROOT / "scenes" / "default.toml"


def test_the_experiment_is_written_beside_what_is_published_and_computed(tmp_path: Path) -> None:
    said: list[str] = []
    with tsa_rig.Rig("sim", scene=SCENE, programs=PROGRAMS) as rig:
        # Three times as fast as the paper: a quarter of a minute less for each sweep.
        rows = paper_bench.run(rig, tmp_path, speed_rad_per_s=4.0, ask=pytest.fail, say=said.append)
    found = {(row["quantity"], row["load_kg"], row["to_load_kg"], row["turns"]): row for row in rows}
    assert len(found) == len(rows) and {row["measured_on"] for row in rows} == {"emulated"}
    for load_kg in paper_bench.LOADS_KG:
        log = tsa_rig.read_log(tmp_path / f"sweep-{load_kg}kg.csv")
        moving = log["state"] == "moving"
        true_m = log["true_position_m"][moving]
        row = found["contraction", load_kg, None, 7.5]
        # The LVDT is as built, not calibrated.
        assert row["measured"] == pytest.approx(1e3 * (true_m.max() - true_m[0]), rel=0.03)
        assert row["measured"] == pytest.approx(row["computed"], rel=0.1)
        assert log["true_load_n"][-1] == pytest.approx(load_kg * 9.80665)
        tr = found["average_tr", load_kg, None, 3.75]
        assert tr["measured"] * found["contraction", load_kg, None, 3.75]["measured"] == pytest.approx(7.5 * np.pi)
        assert tr["published"] is None
    reference = ROOT / "host-tests" / "reference" / "published-ratios.csv"
    quoted = [row for row in csv.DictReader(reference.open()) if row["where"] == "Fig. 13"]
    assert len(quoted) == sum(row["to_load_kg"] is not None for row in rows) > 0
    for ratio in quoted:
        one, other = (round(float(ratio[load]) / 9.81, 1) for load in ("load_n", "to_load_n"))
        row = found[ratio["quantity"], one, other, float(ratio["turns"])]
        assert row["published"] == float(ratio["value"])
        # The speed includes how the motor starts.
        assert row["measured"] == pytest.approx(row["computed"], rel=0.15)
    for row in tsa_rig.published(SCENE):
        if row["id"] in ("exp-0.1", "exp-0.5", "exp-1.5"):
            mine = found["contraction", float(row["id"][4:]), None, 7.5]
            assert mine["published"] == row["published"]
            assert mine["computed"] == pytest.approx(row["computed"], rel=1e-3)
    assert len(list(csv.DictReader((tmp_path / "ratios.csv").open()))) == len(rows)
    page = (tmp_path / "ratios.md").read_text(encoding="utf-8")
    assert "emulated actuator (nominal plant), not a real one" in page and page.count("\n|") == len(rows) + 2
    assert (tmp_path / "fig13.png").read_bytes().startswith(b"\x89PNG") and len(said) == 4


class Real(tsa_rig.Rig):
    """An emulated rig that says it is a real one."""

    def status(self) -> dict[str, Any]:
        return {**super().status(), "rig": None}


def test_on_a_real_rig_the_operator_hangs_the_loads(tmp_path: Path) -> None:
    asked: list[str] = []
    said: list[str] = []

    def ask(text: str) -> None:
        asked.append(text)
        if len(asked) == 2:
            raise KeyboardInterrupt

    with Real("sim", scene=SCENE, programs=PROGRAMS) as rig, pytest.raises(KeyboardInterrupt):
        paper_bench.run(rig, tmp_path, turns=1.0, speed_rad_per_s=4.0, ask=ask, say=said.append)
    assert [text.split(" (")[0] for text in asked] == ["Hang 0.1 kg", "Hang 0.5 kg"]
    assert said == [f"{tmp_path / 'sweep-0.1kg.csv'}: real"]


def test_what_is_missing_or_wrong_is_said_before_anything_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path)]
    with pytest.raises(SystemExit):
        paper_bench.main([*out, "--port", "/dev/none", "--seed", "2"])
    assert "--seed is of an emulated rig" in capsys.readouterr().err
    assert paper_bench.main([*out, "--scene", str(tmp_path / "none.toml")]) == 1
    assert "none.toml" in capsys.readouterr().err
    with tsa_rig.Rig("sim", scene=SCENE, programs=PROGRAMS) as rig:
        with pytest.raises(tsa_rig.ArgumentError, match="speed_rad_per_s"):
            paper_bench.run(rig, tmp_path, speed_rad_per_s=0.0)
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        with pytest.raises(tsa_rig.OperationError, match="pip install matplotlib"):
            paper_bench.run(rig, tmp_path)
        assert rig.latest()["state"] == "unhomed"
