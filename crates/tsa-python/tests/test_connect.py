"""The Python of docs/how-to/integrate.md, run as it stands: on an exported log, and on a served rig."""

import subprocess
import time
from pathlib import Path

import pytest
from test_export import ROOT, TOOL, rigctl

PAGE = (ROOT / "docs" / "how-to" / "integrate.md").read_text(encoding="utf-8")
READS, TALKS = (block.split("\n```")[0] for block in PAGE.split("```python\n")[1:])


def test_a_log_is_read_as_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rigctl("record", "--seconds", "500ms", "--out", tmp_path / "run.csv")
    exec(READS, {})
    said = capsys.readouterr().out
    assert "position_m" in said and ("unhomed" in said or "boot" in said)
    assert (tmp_path / "run.parquet").stat().st_size > 0


def test_a_served_rig_homes_and_moves_as_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    socket = tmp_path / "rig.sock"
    server = subprocess.Popen([TOOL, "serve", "--fast", "--listen", socket], cwd=ROOT, stdout=subprocess.DEVNULL)
    try:
        # The socket's file is there before the board has started; the greeting waits for it.
        while not socket.exists():
            assert server.poll() is None, "the server has ended"
            time.sleep(0.02)
        exec(TALKS, {})
    finally:
        server.terminate()
        assert server.wait(timeout=120) == 0
    said = capsys.readouterr().out
    assert "load_error_n" in said and "error_m" in said and "kind" not in said
    assert not socket.exists()
