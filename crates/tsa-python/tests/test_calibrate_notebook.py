"""The notebook of a calibration does what it says."""

import json
import tempfile
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "calibrate.ipynb"


def test_the_calibrated_actuator_states_smaller_errors_that_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    # Where a notebook has its folder.
    monkeypatch.chdir(NOTEBOOK.parent)
    space: dict[str, Any] = {}
    for number, cell in enumerate(json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None, "stored outputs grow old"
            exec(compile("".join(cell["source"]), f"{NOTEBOOK.name}, cell {number}", "exec"), space)
    before, after = space["before"], space["after"]
    assert before["true_load_n"] == after["true_load_n"] == space["LOAD_N"]
    for name, stated in [("position_m", "position_error_m"), ("load_n", "load_error_n")]:
        assert 0.0 < after[stated] < 0.5 * before[stated], name
        assert abs(after[name] - after[f"true_{name}"]) < after[stated], name
    assert {"k1", "k2", "k3"} <= {constant["name"] for constant in space["identified"]["estimates"]}
    assert space["table"]["kept"] and abs(space["lvdt"]["gap_m"] - space["lvdt"]["true_gap_m"]) < 50e-6
