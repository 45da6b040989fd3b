"""Arguments of any kind: each call answers, or raises an error in words. None ends in a panic of the native part, which
Python shows as a `PanicException`, or in numbers without a reason."""

import json
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tsa_rig
from tsa_rig import _core

ROOT = Path(__file__).resolve().parents[3]
NUMBERS = [0.0, -0.0, 1.0, -1.0, 3.5, 0.5, 5.0, 1e-3, 1e-300, 5e-324, 1e9, -1e9, 1e39, 1e300]
NUMBERS += [math.inf, -math.inf, math.nan]
WORDS = ["solve", "--load", "5N", "-1", "nan", "--turns", "1e999", "", "--json", "\x00"]
OTHERS: list[Any] = [None, "", "5", "5N", b"5", True, {}, {"a": 1}, object(), 1 + 2j, 10**400, [[1.0], [1.0, 2.0]]]
REFUSALS = (TypeError, ValueError, RuntimeError, OverflowError, OSError)


@pytest.fixture(scope="module")
def scene() -> tsa_rig.Scene:
    return tsa_rig.Scene.load(ROOT / "scenes" / "default.toml")


def array(draw: random.Random) -> Any:
    """Numbers of any size in an array of any shape and type, or something that is no number."""
    if draw.random() < 0.2:
        return draw.choice(OTHERS)
    shape = [draw.randrange(4) for _ in range(draw.randrange(4))]
    kind = draw.choice(["f8", "f4", "i4", ">f8", "?"])
    values = [draw.choice(NUMBERS) for _ in range(math.prod(shape))]
    with np.errstate(all="ignore"):
        made = np.array(values).reshape(shape).astype(kind)
    return made.T if draw.random() < 0.3 else made[..., ::2] if shape and draw.random() < 0.3 else made


def answer(call: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """What a call answers; `None` where it refuses."""
    try:
        return call(*arguments, **named)
    except REFUSALS as error:
        assert str(error), f"{call}: an error without words for {arguments} {named}"
        return None


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_arrays_of_any_kind_are_solved_and_looked_up(scene: tsa_rig.Scene) -> None:
    draw, mechanism, table = random.Random(1), scene.mechanism(), scene.table()
    for _ in range(300):
        loads, turns = array(draw), array(draw)
        for call in (mechanism.solve, table.lookup):
            found = answer(call, loads, turns)
            if found is not None:
                assert found.gap_m.shape == found.error.shape == found.load_n.shape
                assert np.array_equal(np.isnan(found.gap_m), found.error != ""), (loads, turns)
        answer(_core.Scene.solve, scene._core, loads, turns)


def test_constants_of_any_kind_make_a_scene_or_are_named(scene: tsa_rig.Scene) -> None:
    draw, keys = random.Random(2), scene.as_dict()
    names = [f"{section}.{key}" for section, table in keys.items() if isinstance(table, dict) for key in table]
    solved = 0
    for _ in range(400):
        name = draw.choice(names)
        kept = keys[name.split(".")[0]][name.split(".")[1]]
        scaled = kept * draw.choice([0.5, 0.9, 1.1, 2.0, 1e3]) if isinstance(kept, float) else kept
        value = draw.choice([scaled, draw.choice(NUMBERS), draw.choice(OTHERS), [draw.choice(NUMBERS)] * 5])
        changed = answer(scene.with_constants, **{name: value})
        if changed is not None:
            found = changed.mechanism().solve([0.5, 5.0], [0.0, 3.0])
            assert np.array_equal(np.isnan(found.gap_m), found.error != ""), (name, value)
            solved += 1
    assert solved > 50
    text = json.dumps(keys)
    for _ in range(300):
        at = draw.randrange(len(text))
        cut = text[:at] + draw.choice(["", "[", "]", "1e999", "null", "-"]) + text[at + draw.randrange(9) :]
        answer(_core.Scene.from_json, cut)
        answer(tsa_rig.Scene.parse, cut)


def test_commands_and_files_of_any_kind_are_refused_in_words(tmp_path: Path) -> None:
    draw, sweep = random.Random(3), tmp_path / "sweep.csv"
    for _ in range(100):
        rows = [[draw.choice(NUMBERS) for _ in range(3)] for _ in range(draw.randrange(6))]
        sweep.write_text("load_n,turns,gap_m\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
        law = draw.choice(["length-ratio", "twist-power", "", "none"])
        material = draw.choice(["modulus", "odd-curve", "curve", ""])
        answer(_core.refit, ROOT / "scenes/default.toml", [str(sweep)], law, material, draw.choice([None, [], [7.0]]))
        answer(_core.tool, [draw.choice(WORDS) for _ in range(5)])


def test_a_sweep_in_millimetres_is_refused_before_it_is_fitted(tmp_path: Path) -> None:
    sweep = tmp_path / "sweep.csv"
    sweep.write_text("load_n,turns,gap_m\n" + "".join(f"5,{turns},{90 - turns}\n" for turns in range(8)))
    with pytest.raises(RuntimeError, match=r"sweep\.csv.*in mm"):
        _core.refit(ROOT / "scenes/default.toml", [str(sweep)], "twist-power", "modulus", None)
