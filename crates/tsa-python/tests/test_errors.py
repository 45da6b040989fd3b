"""What is refused: exceptions of one family, each of a kind, in Python's terms."""

import pickle
from pathlib import Path

import pytest

import tsa_rig

ROOT = Path(__file__).resolve().parents[3]
DEFAULT = ROOT / "scenes/default.toml"


def refused(call: object, *arguments: object, **named: object) -> tsa_rig.RigError:
    assert callable(call)
    with pytest.raises(tsa_rig.RigError) as caught:
        call(*arguments, **named)
    return caught.value


def test_a_missing_file_is_no_bad_scene(tmp_path: Path) -> None:
    missing = refused(tsa_rig.Scene.load, tmp_path / "none.toml")
    assert isinstance(missing, FileNotFoundError) and not isinstance(missing, ValueError)
    assert missing.kind == "no-file" and "none.toml" in str(missing)
    for call in (lambda: tsa_rig.Rig(scene=tmp_path / "none.toml"), lambda: tsa_rig.read_log(tmp_path / "none.csv")):
        assert refused(call).kind == "no-file"
    bad = tmp_path / "bad.toml"
    bad.write_text(DEFAULT.read_text().replace("[string]", "[strings]"))
    wrong = refused(tsa_rig.Scene.load, bad)
    assert wrong.kind == "scene" and isinstance(wrong, ValueError) and "strings" in str(wrong)
    scene = tsa_rig.Scene.load(DEFAULT)
    assert refused(scene.with_constants, rod_radius_m=-1.0).kind == "scene"
    assert refused(scene.with_constants, radius=1.0).kind == "bad-request"


def test_a_scene_is_found_from_a_folder_below_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.toml").write_text(DEFAULT.read_text())
    (tmp_path / "deep" / "er").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "deep" / "er")
    tsa_rig.Scene.load("mine.toml")
    assert refused(tsa_rig.Scene.load, "theirs.toml").kind == "no-file"


def test_they_are_also_pythons_own_and_survive_a_pickle() -> None:
    for error, own in (
        (tsa_rig.ArgumentError, ValueError),
        (tsa_rig.SceneError, ValueError),
        (tsa_rig.MissingFileError, FileNotFoundError),
        (tsa_rig.OperationError, RuntimeError),
    ):
        assert issubclass(error, tsa_rig.RigError) and issubclass(error, own)
        back = pickle.loads(pickle.dumps(error("why", "a-kind")))
        assert type(back) is error and str(back) == "why" and back.kind == "a-kind"


def test_arguments_are_named_as_in_python() -> None:
    mechanism = tsa_rig.Scene.load(DEFAULT).mechanism()
    assert "load_n" in str(refused(mechanism.solve, "five", 3.0))
    assert "turns" in str(refused(mechanism.solve, 5.0, object()))
    assert "rig" in str(refused(tsa_rig.Rig, scene=DEFAULT, rig="soft"))
    device = refused(tsa_rig.Rig, "/dev/no-such-device", scene=DEFAULT)
    assert isinstance(device, tsa_rig.OperationError) and "--" not in str(device)
