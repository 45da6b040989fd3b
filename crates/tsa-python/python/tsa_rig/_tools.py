"""Commands that need no rig: of `rigctl`, by its own code, and of the laboratory's `tsa-lab`, a program of its own."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from os import PathLike, fspath
from typing import Any

from . import _core
from ._errors import of_kind, wrong
from ._places import FilePath, program
from ._places import scene as _scene


def _objects(arguments: list[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in _core.tool(arguments).splitlines()]


def _laboratory(scene: FilePath, arguments: list[str]) -> list[dict[str, Any]]:
    found = _scene(scene)
    words = [fspath(program("tsa-lab", found)), "--json", "--scene", fspath(found), *arguments]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        raise of_kind("bad-request" if done.returncode == 2 else "failed", done.stderr.strip())
    return [json.loads(line) for line in done.stdout.splitlines()]


def published(scene: FilePath) -> list[dict[str, Any]]:
    """The paper's numbers beside those of a scene's model: one dictionary each."""
    return _laboratory(scene, ["published"])


def identify(
    sweeps: Sequence[FilePath], scene: FilePath, out: FilePath | None = None, law: str | None = None, plan: bool = False
) -> dict[str, Any]:
    """Fits a scene's constants to recorded sweeps, as `rigctl identify` does, and says how far they can be trusted.

    Keys as `rigctl identify --json`. Each of the list `estimates` is a constant: its `name`, `value` and the 90 %
    interval from `low` to `high`, in SI units (`modulus` is a1, Pa). `unknown` is what was fitted, the logarithm of a
    positive constant; `standard_error` and `half_width_90` are those of `unknown`.

    `out` is the scene file to write, `law` fixes the radius law, `plan` asks which sweep would tell most. Raises
    ArgumentError for `sweeps` that are no list, and OperationError, naming the file, if one cannot be read or they
    cannot be of one rig.
    """
    if isinstance(sweeps, (str, bytes, PathLike)):
        raise wrong(f"sweeps {sweeps!r} must be a list of files")
    arguments = ["--scene", fspath(_scene(scene)), "identify"]
    arguments += ["--out", fspath(out)] if out is not None else []
    arguments += ["--law", law] if law is not None else []
    arguments += ["--next"] if plan else []
    return _objects([*arguments, "--", *(fspath(sweep) for sweep in sweeps)])[-1]


def budget(scene: FilePath, rig: str = "nominal") -> list[dict[str, Any]]:
    """What sensor, friction, memory, law, tier, table and loop contribute to the errors on a kind of rig."""
    return _laboratory(scene, ["--rig", rig, "budget"])
