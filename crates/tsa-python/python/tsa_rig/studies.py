"""Studies on many cores or machines: designs of the mechanism, the bootstrap of an identification, rigs of many seeds,
and how often the errors hold that the board states.

Each study is a set of independent tasks that a `distributed.Client` runs: on processes of this machine, or on a
cluster.
`pip install "./crates/tsa-python[studies]"` installs what else they need (dask, pandas, pyarrow);
docs/how-to/python.md shows them.

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
from ._errors import of_kind, wrong
from ._model import STANDARD_GRAVITY, Equilibria, Scene, _place
from ._places import FilePath, program
from ._rig import Rig
from ._tools import identify

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
        raise wrong(f"{file} is no result of a study: remove it") from None


RETRIES = 2
"""How often a task is tried again whose worker failed."""


def _run(
    study: str,
    work: Callable[[Task], Any],
    tasks: Sequence[Task],
    client: Client,
    folder: FilePath,
    *,
    failed: Callable[[Task, Exception], Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Any]:
    """The results of all tasks, in their order; those that are in the folder are not computed again.

    The files are written by the caller's process, so that workers need not share the folder. A task that fails in spite
    of `RETRIES` raises, or has the result that `failed` makes of it, which is not kept. `progress` is called with the
    number of tasks that are done and of all.
    """
    place = Path(folder)
    if place.exists() and not place.is_dir():
        raise wrong(f"{place} is a file, and the results need a folder")
    place.mkdir(parents=True, exist_ok=True)
    files = [_file(place, study, task) for task in tasks]
    missing = {file: task for file, task in zip(files, tasks) if not file.exists()}
    futures = {
        client.submit(work, task, key=file.stem, retries=RETRIES): (file, task) for file, task in missing.items()
    }
    instead: dict[Path, Any] = {}
    done = len(set(files)) - len(missing)
    try:
        for future in as_completed(futures):
            file, task = futures[future]
            try:
                result = future.result()
            except Exception as error:
                if failed is None:
                    raise
                instead[file] = failed(task, error)
            else:
                partial = file.with_suffix(f".{os.getpid()}.part")
                partial.write_text(json.dumps({"inputs": task, "result": result}))
                partial.replace(file)
            done += 1
            if progress is not None:
                progress(done, len(set(files)))
    finally:
        client.cancel(list(futures))
    return [instead[file] if file in instead else _kept(file) for file in files]


def _numbers(name: str, values: ArrayLike) -> list[float]:
    """A list of finite numbers, at least one."""
    array = np.atleast_1d(np.asarray(values, dtype=float))
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise wrong(f"{name} must be a list of finite numbers, and is {values!r}")
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

    Raises ArgumentError, naming it, for a constant that is unknown, and for an empty list.
    """
    keys = Scene.load(scene).as_dict()
    loads = _numbers("loads_n", loads_n)
    if min(loads) <= 0.0:
        raise wrong(f"loads_n must be above 0, and has {min(loads)}")
    for name, value in (("travel_m", travel_m), ("turns", turns)):
        if not (np.isfinite(value) and value > 0.0):
            raise wrong(f"{name} must be above 0 and finite, and is {value}")
    if not grid:
        raise wrong("the grid is empty: it needs at least one constant")
    for name, values in grid.items():
        _place(keys, name)
        if isinstance(values, str) or not hasattr(values, "__len__") or len(values) == 0:
            raise wrong(f"the grid has no list of values for {name}")
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
    for load_n, way in zip(loads, ways):
        if way["contraction_m"].size < 2 or way["contraction_m"][-1] < 0.5 * travel_m:
            continue
        # Where lighter loads have no equilibrium there is no torque: it is then the last one, or what lifts the load.
        known = ~np.isnan(way["torque_nm"])
        torque_nm = load_n / way["tr_rad_per_m"]
        if known.any():
            torque_nm = np.interp(way["contraction_m"], way["contraction_m"][known], way["torque_nm"][known])
        current_a = np.abs(torque_nm) / gear / torque_constant
        ratio, torque_a = (
            float(np.interp(0.5 * travel_m, way["contraction_m"], values))
            for values in (way["tr_rad_per_m"], current_a)
        )
        # The supply drives the current through the winding, and the rest is left for the speed.
        voltage_speed = (rig["supply_voltage_v"] - torque_a * rig["motor_resistance_ohm"]) / torque_constant
        speeds.append(max(0.0, min(rig["motor_speed_max_rad_per_s"], voltage_speed)) / gear / ratio)
        ratios.append(ratio)
        at_end_a = float(np.interp(travel_m, way["contraction_m"], current_a))
        currents.append(float(np.max(current_a[way["contraction_m"] <= travel_m], initial=at_end_a)))
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

    Raises ArgumentError for fewer than two resamples or no sweep, OperationError if the sweeps cannot tell the
    constants.
    """
    if isinstance(sweeps, (str, PathLike)) or len(sweeps) == 0:
        raise wrong("sweeps must be a list of at least one file")
    if resamples < 2:
        raise wrong(f"resamples must be at least 2, and is {resamples}")
    keys = Scene.load(scene).as_dict()
    for sweep in sweeps:
        if not Path(sweep).is_file():
            raise wrong(f"sweep {fspath(sweep)} is not a file")
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
        raise of_kind("failed", fitted["refused"])
    drawn = [constants for constants in drawn if "refused" not in constants]
    if len(drawn) < 2:
        raise of_kind("failed", "fewer than two resamples have a fit")
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

    Raises ArgumentError for an empty list, MissingFileError if the emulator is not built.
    """
    drawn = [int(number) for number in numbers]
    if not drawn:
        raise wrong("seeds: the list of numbers is empty")
    targets = _numbers("targets_m", targets_m)
    emulator = program("rig-emulator", scene, programs)
    found = emulator.parent
    images = [emulator, found.parent / "firmware" / "tsa-firmware.elf"]
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


CHUNK = 20
"""Trials of one task of `trials`."""


def trials(
    seeds: Iterable[int],
    *,
    client: Client,
    folder: FilePath,
    kinds: Sequence[str] = ("nominal", "hard"),
    progress: Callable[[int, int], None] | None = None,
) -> pd.DataFrame:
    """What does the board state on thousands of emulated rigs as built, and what is true? One row for each moment.

    Each trial is a rig of a kind on the fast bench (the firmware's control code and the plant in one process). Its
    loads, its place, its temperature and whether it has worked before are drawn from the seed. It is homed, moved,
    given another load and moved again. The table is also written to the folder as `trials-HASH.parquet`, which the
    inputs and the code of the package name. Columns:

    - `kind`, `seed`, `worked_n` (load of the work before, N), `moment` (homed, arrived, changed, moved)
    - `true_load_n`, `load_n`, `load_error_n`, `doubts`: the weight, and what the board states of it (N)
    - `true_position_m`, `position_m`, `position_error_m`: the same of the position since homing (m)
    - `ended`: why the trial ended early. A trial without any moment, or whose worker failed, has one row of it

    Raises ArgumentError for an empty list and an unknown kind.
    """
    drawn = [int(seed) for seed in seeds]
    if not drawn or not kinds:
        raise wrong(f"{'kinds' if drawn else 'seeds'}: the list is empty")
    for kind in kinds:
        if kind not in ("ideal", "nominal", "hard"):
            raise wrong(f"kinds: there is no kind of rig {kind!r}; there are ideal, nominal and hard")
    code = _contents([str(_core.__file__)])
    tasks: list[Task] = [
        {"kind": kind, "seeds": drawn[start : start + CHUNK], "contents": code}
        for kind in kinds
        for start in range(0, len(drawn), CHUNK)
    ]
    rows = _run("trials", _trials, tasks, client, folder, failed=_untried, progress=progress)
    found = pd.DataFrame(list(itertools.chain.from_iterable(rows)), columns=TRIAL_COLUMNS)
    name = _file(Path(folder), "trials", {"tasks": tasks}).with_suffix(".parquet")
    found.to_parquet(name)
    return found


TRIAL_COLUMNS = [
    *("kind", "seed", "worked_n", "moment", "true_load_n", "load_n", "load_error_n", "doubts"),
    *("true_position_m", "position_m", "position_error_m", "ended"),
]


def _trials(task: Task) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for seed in task["seeds"]:
        tried = json.loads(_core.trial(task["kind"], seed))
        about = {name: tried[name] for name in ("kind", "seed", "worked_n", "ended")}
        rows.extend({**about, **stated} for stated in tried["stated"] or [{}])
    return rows


def _untried(task: Task, error: Exception) -> list[dict[str, Any]]:
    return [{"kind": task["kind"], "seed": seed, "ended": f"worker: {error}"} for seed in task["seeds"]]


Z90 = 1.6448536
"""Standard deviations that hold 90 % of a normal distribution."""


def coverage(rows: pd.DataFrame, by: Sequence[str] = ("kind", "moment")) -> pd.DataFrame:
    """How often do the stated 90 % errors hold the truth? One row for each group of `trials`.

    `by` names columns of the trials, or `load`: light below 0.3 kg, heavy from 0.9 kg, middle in between. Columns for
    `load` and `position`: `n`, `held` (the fraction), `low` and `high` (its 90 % interval, by Wilson), `stated` (median
    of the stated error) and `error` (90th percentile of the size of the true one), in N and m.
    """
    kg = rows["true_load_n"] / STANDARD_GRAVITY
    rows = rows.assign(load=np.select([kg < 0.3, kg >= 0.9], ["light", "heavy"], "middle"))
    found = []
    for group, members in rows[rows["true_load_n"].notna()].groupby(list(by), sort=True):
        row: dict[str, Any] = dict(zip(by, group))
        for what, unit in (("load", "n"), ("position", "m")):
            part = members.dropna(subset=[f"{what}_{unit}", f"{what}_error_{unit}"])
            error = (part[f"{what}_{unit}"] - part[f"true_{what}_{unit}"]).abs()
            stated = part[f"{what}_error_{unit}"]
            n, held = len(part), float((error <= stated).mean())
            middle, half = held + Z90**2 / (2 * n), Z90 * np.sqrt(held * (1 - held) / n + Z90**2 / (4 * n**2))
            row |= {f"{what}_n": n, f"{what}_held": held}
            low, high = ((middle + side) / (1 + Z90**2 / n) for side in (-half, half))
            row |= {f"{what}_low": low, f"{what}_high": high}
            row |= {f"{what}_stated": stated.median(), f"{what}_error": error.quantile(0.9)}
        found.append(row)
    return pd.DataFrame(found)
