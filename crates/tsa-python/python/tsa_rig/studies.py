"""Studies on many cores or machines: designs of the mechanism, the bootstrap of an identification, rigs of many seeds.

Each study is a set of independent tasks that a `distributed.Client` runs: on processes of this machine, or on a
cluster.
`pip install "./crates/tsa-python[studies]"` installs what they need besides (dask, pandas); docs/how-to/python.md shows
them.

The result of each task is a file in a folder that the caller names. A study that was stopped and is started again with
the same folder computes only what is missing. Files are found by a hash of the task's inputs, the contents of all files
among them, so that a changed input is another task.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from distributed import Client, as_completed
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._model import Equilibria, Scene, _place
from ._rig import Rig, _programs
from ._tools import identify

FilePath = str | PathLike[str]
Task = dict[str, Any]
"""Inputs of a task: plain data that JSON can hold. Its key `contents` is for the hash alone."""

STEPS = 80
"""Steps of twist in which a design is followed."""


def _contents(files: Iterable[FilePath]) -> list[str]:
    """SHA-256 of each file."""
    return [hashlib.sha256(Path(file).read_bytes()).hexdigest() for file in files]


def _file(folder: Path, study: str, task: Task) -> Path:
    """Where a task's result is kept. Another version of the package may compute another result."""
    inputs = json.dumps([study, version("tsa-rig"), task], sort_keys=True)
    return folder / f"{study}-{hashlib.sha256(inputs.encode()).hexdigest()[:32]}.json"


def _kept(file: Path) -> Any:
    try:
        return json.loads(file.read_text())["result"]
    except (ValueError, KeyError, TypeError):
        raise ValueError(f"{file} is no result of a study: remove it") from None


def _run(study: str, work: Callable[[Task], Any], tasks: Sequence[Task], client: Client, folder: FilePath) -> list[Any]:
    """The results of all tasks, in their order; those that are in the folder are not computed again.

    The files are written by the caller's process, so that workers need not share the folder.
    """
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise ValueError(f"{place} is a file, and the results need a folder")
    place.mkdir(parents=True, exist_ok=True)
    files = [_file(place, study, task) for task in tasks]
    missing = {file: task for file, task in zip(files, tasks) if not file.exists()}
    futures = {client.submit(work, task, key=file.stem): (file, task) for file, task in missing.items()}
    try:
        for future in as_completed(futures):
            file, task = futures[future]
            partial = file.with_suffix(f".{os.getpid()}.part")
            partial.write_text(json.dumps({"inputs": task, "result": future.result()}))
            partial.replace(file)
    finally:
        client.cancel(list(futures))
    return [_kept(file) for file in files]


def _numbers(name: str, values: ArrayLike) -> list[float]:
    """A list of finite numbers, at least one."""
    array = np.atleast_1d(np.asarray(values, dtype=float))
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"{name} must be a list of finite numbers, and is {values!r}")
    return [float(value) for value in array]


def designs(
    scene: FilePath,
    grid: Mapping[str, Sequence[Any]],
    loads_n: ArrayLike,
    travel_m: float,
    *,
    client: Client,
    folder: FilePath,
    turns: float = 12.0,
) -> pd.DataFrame:
    """Which rods and strings serve a range of loads (N) and a travel (m)? One row for each combination of a grid.

    `grid` has lists of values by the names of constants, as `Scene.with_constants` takes them. Each design is followed
    from the half-turn pre-twist up to a number of `turns` under each load. Columns besides the constants:

    - `reach_m`: the contraction that is reached under every load (m)
    - `limits`: what ended it before `turns`, under any load
    - `tr_least_rad_per_m`, `tr_greatest_rad_per_m`: the transmission ratio at half the travel over the loads
    - `speed_m_per_s`: the load's speed there with the motor at its limit of speed and voltage, under the slowest load
    - `current_a`: the maximum current of the motor within the travel, without friction
    - `serves`: whether the travel is reached under every load within the drive's current limit
    - `refused`: why a scene with these constants is none; the other columns are then empty

    Raises ValueError, naming it, for a constant that is unknown, and for an empty list.
    """
    keys = Scene.load(scene).as_dict()
    loads = _numbers("loads_n", loads_n)
    if min(loads) <= 0.0:
        raise ValueError(f"loads_n must be above 0, and has {min(loads)}")
    for name, value in (("travel_m", travel_m), ("turns", turns)):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be above 0 and finite, and is {value}")
    if not grid:
        raise ValueError("the grid is empty: it needs at least one constant")
    for name, values in grid.items():
        _place(keys, name)
        if isinstance(values, str) or not hasattr(values, "__len__") or len(values) == 0:
            raise ValueError(f"the grid has no list of values for {name}")
    # What a table must cover is another question.
    keys.pop("envelope", None)
    keys.pop("accuracy", None)
    plain = [[value.item() if isinstance(value, np.generic) else value for value in values] for values in grid.values()]
    tasks: list[Task] = [
        {
            "scene": keys,
            "constants": dict(zip(grid, values)),
            "loads_n": loads,
            "travel_m": float(travel_m),
            "turns": float(turns),
        }
        for values in itertools.product(*plain)
    ]
    rows = _run("design", _design, tasks, client, folder)
    return pd.DataFrame([{**task["constants"], **row} for task, row in zip(tasks, rows)])


# What ends the way of a design, by a word of the model's message.
_LIMITS = {"overtwist": "overtwist", "strain": "strain", "no equilibrium": "no equilibrium", "folds": "fold"}


def _limit(error: str) -> str:
    return next((limit for word, limit in _LIMITS.items() if word in error), error)


def _design(task: Task) -> dict[str, Any]:
    try:
        scene = Scene.from_dict(task["scene"]).with_constants(**task["constants"])
    except ValueError as error:
        return {"serves": False, "refused": str(error)}
    loads, travel_m = np.array(task["loads_n"]), task["travel_m"]
    ways, limits = _ways(scene, loads, task["turns"])
    rig = scene.as_dict()["rig"]
    gear = rig["gear_ratio"][0] / rig["gear_ratio"][1]
    torque_constant = rig["motor_torque_constant_nm_per_a"]
    reach_m = min((way["contraction_m"][-1] if way["contraction_m"].size else 0.0) for way in ways)
    ratios, speeds, currents = [], [], []
    for way in ways:
        if way["contraction_m"].size < 2 or way["contraction_m"][-1] < 0.5 * travel_m:
            continue
        current_a = np.abs(way["torque_nm"]) / gear / torque_constant
        ratio, torque_a = (
            float(np.interp(0.5 * travel_m, way["contraction_m"], values))
            for values in (way["tr_rad_per_m"], current_a)
        )
        # The supply drives the current through the winding, and the rest is left for the speed.
        voltage_speed = (rig["supply_voltage_v"] - torque_a * rig["motor_resistance_ohm"]) / torque_constant
        speeds.append(max(0.0, min(rig["motor_speed_max_rad_per_s"], voltage_speed)) / gear / ratio)
        ratios.append(ratio)
        currents.append(float(np.max(current_a[way["contraction_m"] <= travel_m])))
    all_loads = len(ratios) == len(ways)
    current_a = max(currents) if all_loads else None
    return {
        "reach_m": float(reach_m),
        "limits": ", ".join(sorted(limits)),
        "tr_least_rad_per_m": min(ratios) if all_loads else None,
        "tr_greatest_rad_per_m": max(ratios) if all_loads else None,
        "speed_m_per_s": min(speeds) if all_loads else None,
        "current_a": current_a,
        "serves": bool(current_a is not None and reach_m >= travel_m and current_a <= rig["drive_current_limit_a"]),
        "refused": "",
    }


def _ways(scene: Scene, loads_n: NDArray[np.float64], turns: float) -> tuple[list[dict[str, Any]], set[str]]:
    """The states under each load up to the first one that the model refuses, and the limits that refused them.

    States beyond a limit are not asked for: to refuse one takes much longer than to solve it.
    """
    mechanism, limits = scene.mechanism(), set()
    names = ("contraction_m", "tr_rad_per_m", "torque_nm")
    ways: list[dict[str, list[float]]] = [{name: [] for name in names} for _ in loads_n]
    going = np.arange(loads_n.size)
    for turn in np.linspace(0.0, turns, STEPS + 1):
        if going.size == 0:
            break
        solved: Equilibria = mechanism.solve(loads_n[going], turn)
        limits |= {_limit(str(error)) for error in solved.error if error}
        for k, load in enumerate(going):
            if not solved.error[k]:
                for name in names:
                    ways[load][name].append(float(getattr(solved, name)[k]))
        going = going[solved.error == ""]
    return [{name: np.array(values) for name, values in way.items()} for way in ways], limits


def bootstrap(
    sweeps: Sequence[FilePath],
    scene: FilePath,
    resamples: int = 200,
    *,
    client: Client,
    folder: FilePath,
    law: str | None = None,
    seed: int = 1,
) -> pd.DataFrame:
    """How far can the constants of an identification be trusted? One row for each constant that the fit changes.

    The law is chosen once, as `identify` does. It is then fitted again to resamples: residuals change places in blocks
    of twist, and what is expected of the constants beforehand is drawn again. Columns: `constant`, `value` (fitted to
    the sweeps themselves), `low` and `high` (between which nine of ten resamples lie), `standard_error`, `resamples`
    (that had a fit). The workers must find the sweeps under the same paths.

    Raises ValueError for fewer than two resamples or no sweep, RuntimeError if the sweeps cannot tell the constants.
    """
    if isinstance(sweeps, (str, PathLike)) or len(sweeps) == 0:
        raise ValueError("sweeps must be a list of at least one file")
    if resamples < 2:
        raise ValueError(f"resamples must be at least 2, and is {resamples}")
    keys = Scene.load(scene).as_dict()
    for sweep in sweeps:
        if not Path(sweep).is_file():
            raise ValueError(f"sweep {fspath(sweep)} is not a file")
    paths = [str(Path(sweep).resolve()) for sweep in sweeps]
    inputs: Task = {
        "scene": str(Path(scene).resolve()),
        "sweeps": paths,
        "contents": [keys, *_contents(paths)],
    }
    chosen = _run("identify", _identify, [{**inputs, "law": law}], client, folder)[0]
    seeds = [None, *range(seed, seed + resamples)]
    tasks: list[Task] = [{**inputs, **chosen, "seed": number} for number in seeds]
    fitted, *drawn = _run("bootstrap", _refit, tasks, client, folder)
    if "refused" in fitted:
        raise RuntimeError(fitted["refused"])
    drawn = [constants for constants in drawn if "refused" not in constants]
    if len(drawn) < 2:
        raise RuntimeError("fewer than two resamples have a fit")
    rows = []
    for name, value in fitted.items():
        values = np.array([constants[name] for constants in drawn])
        if np.ptp(values) == 0.0:
            continue
        low, high = np.quantile(values, [0.05, 0.95])
        error = np.std(values, ddof=1)
        rows.append((name, value, float(low), float(high), float(error), values.size))
    return pd.DataFrame(rows, columns=["constant", "value", "low", "high", "standard_error", "resamples"])


def _identify(task: Task) -> dict[str, str]:
    chosen = identify(task["sweeps"], task["scene"], law=task["law"])["chosen"]
    return {"law": chosen["law"], "material": chosen["material"]}


BLOCKS = 4
"""Blocks of each sweep's residuals: as many as the laws compete on."""


def _resampled(fit: dict[str, Any], random: np.random.Generator) -> list[float]:
    """The rows' values with the residuals of each sweep in other places.

    Those of neighbouring rows are alike, because what a law leaves is smooth. They are therefore drawn in blocks of
    twist (moving blocks: Künsch, "The jackknife and the bootstrap for general stationary observations", 1989).
    """
    values, deviations = np.array(fit["values"]), np.array(fit["deviations"])
    computed = np.array(fit["computed"], dtype=float)
    for sweep in fit["sweeps"]:
        rows = [row for row in sweep if np.isfinite(computed[row])]
        residuals = (values[rows] - computed[rows]) / deviations[rows]
        length = max(1, -(-residuals.size // BLOCKS))
        starts = random.integers(0, residuals.size - length + 1, BLOCKS) if rows else np.zeros(0, dtype=int)
        drawn = np.concatenate([residuals[start : start + length] for start in starts]) if rows else residuals
        values[rows] = computed[rows] + drawn[: residuals.size] * deviations[rows]
    drawn_values: list[float] = values.tolist()
    return drawn_values


def _refit(task: Task) -> dict[str, Any]:
    """The constants of the mechanism by their keys.

    For a resample, what is expected of the constants beforehand is drawn again from its own spread, too: otherwise a
    constant that only the expectation tells would not vary (Bardsley and others, "Randomize-then-optimize", 2014).
    """
    arguments = task["scene"], task["sweeps"], task["law"], task["material"]
    try:
        fit = json.loads(_core.refit(*arguments))
        if task["seed"] is not None:
            random = np.random.default_rng(task["seed"])
            values = _resampled(fit, random)
            fit = json.loads(_core.refit(*arguments, values, random.standard_normal(fit["unknowns"]).tolist()))
    except RuntimeError as error:
        return {"refused": str(error)}
    scene = fit["scene"]
    constants = {}
    for section in ("geometry", "string", "material"):
        for key, value in scene[section].items():
            if isinstance(value, list):
                listed, names = value, [f"{section}.{key}.{k}" for k in range(len(value))]
            else:
                listed, names = [value], [f"{section}.{key}"]
            constants.update({name: number for name, number in zip(names, listed) if isinstance(number, (int, float))})
    return constants


def seeds(
    scene: FilePath,
    numbers: Iterable[int],
    targets_m: ArrayLike,
    *,
    client: Client,
    folder: FilePath,
    rig: str = "nominal",
    plant: Mapping[str, object] | None = None,
    speed: float = 0.002,
    programs: FilePath | None = None,
) -> pd.DataFrame:
    """How well do emulated rigs of many seeds home and move? One row for each seed and target.

    Each rig of the kind `rig` homes and moves to the targets (m), one after the other, at a `speed` (m/s). `plant` and
    `programs` are those of `Rig`. The workers must find scene and programs under the same paths. Columns:

    - `load_n`, `load_error_n`: the weighed load (N) and the error that the board states
    - `true_load_n`: the load that hung
    - `error_m`: where the board says that the move ended, from its target (m); `true_error_m`: where it did end
    - `refused`: the board's refusal or fault, after which this rig's other columns are empty

    Raises ValueError for an empty list, RuntimeError if the emulator is not built.
    """
    drawn = [int(number) for number in numbers]
    if not drawn:
        raise ValueError("seeds: the list of numbers is empty")
    targets = _numbers("targets_m", targets_m)
    found = Path(programs) if programs is not None else _programs(Path(scene))
    if found is None or not (found / "rig-emulator").exists():
        raise RuntimeError("the emulator is not built: run `cargo xtask build` in the checkout, or give `programs`")
    images = [found / "rig-emulator", found.parent / "firmware" / "tsa-firmware.elf"]
    inputs: Task = {
        "scene": str(Path(scene).resolve()),
        "rig": rig,
        "plant": {key: str(value) for key, value in (plant or {}).items()},
        "targets_m": targets,
        "speed": float(speed),
        "programs": str(found.resolve()),
        "contents": [Scene.load(scene).as_dict(), *_contents(image for image in images if image.exists())],
    }
    rows = _run("seed", _seed, [{**inputs, "seed": number} for number in drawn], client, folder)
    return pd.DataFrame(list(itertools.chain.from_iterable(rows)))


def _seed(task: Task) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    about: dict[str, Any] = {"seed": task["seed"], "refused": ""}
    board = Rig(
        "sim", scene=task["scene"], rig=task["rig"], seed=task["seed"], plant=task["plant"], programs=task["programs"]
    )
    with board:
        try:
            homed = board.home()
            about |= {"load_n": homed["load_n"], "load_error_n": homed["load_error_n"]}
            about["true_load_n"] = float(board.telemetry()["true_load_n"][-1])
            for target_m in task["targets_m"]:
                about["target_m"] = target_m
                moved = board.move(target_m, speed=task["speed"])
                rows.append({**about, "error_m": moved["error_m"], "true_error_m": moved["true_error_m"]})
        except RuntimeError as error:
            rows.append({**about, "refused": str(error)})
    return rows
