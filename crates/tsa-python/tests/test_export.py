"""What `rigctl export` writes, read by the formats' own Python readers."""

import json
import os
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from mcap.reader import make_reader
from tsa_rig import read_log

ROOT = Path(__file__).resolve().parents[3]
# Where `cargo xtask python` has built the tool.
TOOL = Path(os.environ.get("TSA_PROGRAMS", ROOT / "target" / "release")) / "rigctl"
WORDS = {"state", "fault", "faults", "limit", "doubts", "load_at_range_end", "homing_failure"}


def rigctl(*arguments: str | Path) -> None:
    subprocess.run([TOOL, *arguments], cwd=ROOT, check=True, capture_output=True)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    script = folder / "a.script"
    script.write_text("2.5 move 5mm\n2.6 home load=0.5kg\n33 move 4mm speed=4mm/s\n36 end\n")
    path = folder / "run.csv"
    # The first move is refused, because the rig is not homed: the log is whole all the same.
    tool: list[str | Path] = [TOOL, "record", "--script", script, "--out", path, "--seed", "3"]
    assert subprocess.run(tool, cwd=ROOT, capture_output=True).returncode == 1
    return path


@pytest.fixture(scope="module")
def rows(log: Path) -> pd.DataFrame:
    return pd.read_csv(log, comment="#")


def test_csv_is_read_without_options(log: Path, rows: pd.DataFrame, tmp_path: Path) -> None:
    out = tmp_path / "run.csv"
    rigctl("export", log, "--to", "csv", "--out", out)
    read = pd.read_csv(out)
    pd.testing.assert_frame_equal(read, rows)
    assert len(read) > 3000 and read["load_n"].isna().iloc[0] and not read["load_n"].isna().iloc[-1]


def test_a_log_is_read_as_arrays_and_written_as_parquet(log: Path, rows: pd.DataFrame, tmp_path: Path) -> None:
    columns = read_log(log)
    assert list(columns) == list(rows.columns)
    out = tmp_path / "run.parquet"
    pd.DataFrame(columns).to_parquet(out)
    read = pd.read_parquet(out)
    for name in rows.columns:
        assert columns[name].dtype == (object if name in WORDS else float), name
        assert (read[name].isna() == rows[name].isna()).all(), name
        known = rows[name].notna()
        assert (read[name][known] == rows[name][known]).all(), name


def test_what_is_no_whole_log_is_refused(log: Path, tmp_path: Path) -> None:
    text = log.read_text()
    bad = tmp_path / "bad.csv"
    for content, said in [
        ("", "not a log"),
        ("load_n,turns\n1,2\n", "not a log"),
        (text[: len(text) // 2], "cut short after"),
        (text.replace("# end rows = ", "# end rows = 1"), "cut short after"),
    ]:
        bad.write_text(content)
        with pytest.raises(ValueError, match=said):
            read_log(bad)


def test_mcap_is_json_with_schemas_at_the_hosts_times(log: Path, rows: pd.DataFrame, tmp_path: Path) -> None:
    out = tmp_path / "run.mcap"
    rigctl("export", log, "--to", "mcap", "--out", out)
    telemetry, events, times = [], [], []
    with out.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        facts = {record.name: record.metadata for record in reader.iter_metadata()}
        for schema, channel, message in reader.iter_messages():
            assert schema is not None and schema.encoding == "jsonschema" and channel.message_encoding == "json"
            content = json.loads(message.data)
            fields = json.loads(schema.data)["properties"]
            assert set(content) <= set(fields) and message.log_time == message.publish_time
            if channel.topic == "/telemetry":
                times.append((message.log_time, content["t_s"]))
                telemetry.append(content)
                # One plain type each: Foxglove refuses a field that may be a number or null.
                assert {name: kind["type"] for name, kind in fields.items()} == {
                    name: "string" if name in WORDS else "number" for name in rows.columns
                }
            else:
                assert (channel.topic, schema.name) == ("/log", "foxglove.Log")
                events.append(content)
    assert facts["tsa-log"]["seed"] == "3"
    # The clock of the host at the first row.
    first_ns, first_s = times[0]
    assert abs(first_ns / 1e9 - log.stat().st_mtime) < 3600.0
    assert pd.Timestamp(facts["tsa-log"]["host_time"]).value == first_ns
    assert all(abs((ns - first_ns) - (t_s - first_s) * 1e9) <= 500.0 for ns, t_s in times)
    assert [one["message"].split()[0] for one in events if one["name"] == "request"] == ["move", "home", "move"]
    assert len(telemetry) == len(rows)
    for index, row in enumerate(telemetry):
        assert row == rows.iloc[index].dropna().to_dict()
