"""Many emulated rigs in this process, without the emulated chip."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import wrong
from ._model import Array, Scene, numbers, plant_changes, seed
from ._places import DEFAULT_SCENE, FilePath

TICK_S = 0.01
"""Time of one tick of the control code (s)."""

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Trace:
    """What some ticks showed: arrays of shape (rigs, ticks), by key. A failed rig has NaN and empty words."""

    telemetry: Columns
    """What the sensors and, on a `Bench`, the control code say."""
    truth: Columns
    """What is true."""


def _unpacked(ticks: _core.Ticks) -> Trace:
    (numbers, words, truth), values, known = ticks
    columns = iter(np.moveaxis(values, 2, 0))
    telemetry: Columns = {name: next(columns) for name in numbers}
    # A rig that has failed has no places of words: -1 is the end of the list.
    spelled = np.array([*known, ""], dtype=np.str_)
    telemetry |= {name: spelled[np.nan_to_num(next(columns), nan=-1.0).astype(int)] for name in words}
    return Trace(telemetry, {name: next(columns) for name in truth})


def _now(columns: Columns) -> Columns:
    return {name: values[:, -1] for name, values in columns.items()}


def _count(ticks: int) -> int:
    if not isinstance(ticks, (int, np.integer)) or not 1 <= ticks <= 10_000_000:
        raise wrong(f"ticks {ticks!r} must be a whole number from 1 to 10 000 000")
    return int(ticks)


def _arguments(
    scene: Scene | FilePath, seeds: Iterable[int], plant: Mapping[str, object] | None
) -> tuple[_core.Scene, list[int], list[str]]:
    found = scene if isinstance(scene, Scene) else Scene.load(scene)
    try:
        given = list(seeds)
    except TypeError as error:
        raise wrong(f"seeds: {error}") from None
    if not given:
        raise wrong("seeds must be whole numbers from 0 to 2^64 - 1, at least one")
    return found._core, [seed("seeds", value) for value in given], plant_changes(plant)


class _Rigs:
    """What `Bench` and `Plant` share."""

    _core: _core.Bench | _core.Plant
    seeds: NDArray[np.uint64]
    """The seed of each rig, shape (rigs,)."""

    @property
    def error(self) -> NDArray[np.str_]:
        """Why a rig could not be built or started; empty for the others. Shape (rigs,)."""
        return np.array(self._core.errors(), dtype=np.str_)

    def telemetry(self) -> Columns:
        """What the sensors and, on a `Bench`, the control code say now: arrays of shape (rigs,), by key."""
        return _now(_unpacked(self._core.ticks(0)).telemetry)

    def truth(self) -> Columns:
        """What is true now: arrays of shape (rigs,), by key. SI units; the names are those of `rig_plant::Truth`.

        `t_s` is each rig's own time since power-up, `gap_m` the gap between the clamps, `twist_rad` the twist of the
        strings, `load_n` the weight on the rail, `pull_n` what the mechanism carries, `driven_rad` what the motor has
        turned by its own torque.
        """
        return _now(_unpacked(self._core.ticks(0)).truth)

    def _spread(self, name: str, values: ArrayLike) -> list[float]:
        """A number for each rig."""
        given, shape = numbers(name, values), self.seeds.shape
        try:
            return [float(value) for value in np.broadcast_to(given, shape)]
        except ValueError:
            raise wrong(f"{name} of shape {given.shape} must be a number, or have the shape {shape}") from None


class Bench(_Rigs):
    """Emulated rigs under the firmware's own control code, all in this process, on all cores, without Python's lock.

    `rig` is the kind (ideal, nominal, hard) that `seeds` draw, one rig each; `plant` changes keys of all of them
    (docs/reference/simulator.md), for example `{"load": "0.5kg"}`. The control code has the table of the scene. The
    chip is left out: its drivers, interrupts and timing are those of `Rig("sim")` only.

    Each rig has its own time, which passes in `home`, `move` and `step` only. What is refused or fails on one rig is
    its row in `error`, and its other columns are NaN; the other rigs go on.

    Raises MissingFileError (a FileNotFoundError) or SceneError for the scene, ArgumentError for the other arguments.
    """

    def __init__(
        self,
        scene: Scene | FilePath = DEFAULT_SCENE,
        rig: str = "nominal",
        seeds: Iterable[int] = (1,),
        plant: Mapping[str, object] | None = None,
    ) -> None:
        core, drawn, changes = _arguments(scene, seeds, plant)
        self.seeds = np.array(drawn, dtype=np.uint64)
        self._core: _core.Bench = _core.Bench(core, rig, drawn, changes)

    def home(self, load_n: ArrayLike = np.nan) -> Columns:
        """Starts the drives and homes all rigs, each until its own end.

        `load_n` is the load if it is known (N), a number or one for each rig; NaN is not known. Arrays of shape
        (rigs,): `load_n`, `load_error_n`, `friction_n`, `zero_error_rad`, `reference_gap_m`, `duration_s`, and
        `error`, which is empty where the homing succeeded.
        """
        return _results(self._core.home(self._spread("load_n", load_n)))

    def move(
        self, target_m: ArrayLike, speed: ArrayLike = 0.002, load_n: ArrayLike = np.nan, *, wait: bool = True
    ) -> Columns:
        """Brings the loads to positions (m) at speeds (m/s) at most, each until its own end.

        Each argument is a number or one for each rig. Arrays of shape (rigs,), as `rigctl move --json` names them:
        `target_m`, `position_m` (measured at rest), `error_m`, `true_error_m`, `position_error_m`, `load_n`,
        `load_error_n`, `tr_start_rad_per_m`, `tr_end_rad_per_m`, `turns`, `duration_s`, and `error`. With `wait=False`
        the moves only begin, in one tick, and the answer has `error` alone: `step` follows them.
        """
        names = (("target_m", target_m), ("speed", speed), ("load_n", load_n))
        targets_m, speeds_m_per_s, loads_n = (self._spread(name, values) for name, values in names)
        return _results(self._core.move_to(targets_m, speeds_m_per_s, loads_n, wait))

    def step(self, ticks: int = 1) -> Trace:
        """Lets ticks of 10 ms pass on all rigs: telemetry and truth as arrays of shape (rigs, ticks).

        Keys of the telemetry are those of `Rig.telemetry` without `string_tension_n`.
        """
        return _unpacked(self._core.ticks(_count(ticks)))

    def copy(self) -> Bench:
        """All rigs as they are now, with their control code: both then go on alike."""
        copy = Bench.__new__(Bench)
        copy.seeds, copy._core = self.seeds.copy(), self._core.copy()
        return copy


class Plant(_Rigs):
    """Emulated rigs without control code: the motors turn as `step` says, all in this process and on all cores.

    Arguments and errors are those of `Bench`. The drives have started, and hold.
    """

    def __init__(
        self,
        scene: Scene | FilePath = DEFAULT_SCENE,
        rig: str = "nominal",
        seeds: Iterable[int] = (1,),
        plant: Mapping[str, object] | None = None,
    ) -> None:
        core, drawn, changes = _arguments(scene, seeds, plant)
        self.seeds = np.array(drawn, dtype=np.uint64)
        self._core: _core.Plant = _core.Plant(core, rig, drawn, changes)
        keys = json.loads(core.json())["rig"]
        self._limits: tuple[float, float] = keys["drive_current_limit_a"], keys["motor_speed_max_rad_per_s"]

    @property
    def current_limit_a(self) -> float:
        """Maximum of a current (A): the scene's `drive_current_limit_a`."""
        return self._limits[0]

    @property
    def speed_max_rad_per_s(self) -> float:
        """Maximum of a speed of the motor shaft (rad/s): the scene's `motor_speed_max_rad_per_s`."""
        return self._limits[1]

    def step(
        self, speed_rad_per_s: ArrayLike = 0.0, current_a: ArrayLike | None = None, ticks: int = 1
    ) -> Trace:
        """Lets ticks of 10 ms pass with these targets: sensors and truth as arrays of shape (rigs, ticks).

        `speed_rad_per_s` is the speed of the motor shaft, positive twists up, and `current_a` the maximum current; each
        is a number or one for each rig. A small current makes it a target of the torque. The drive gets what the
        control code would send: a position that moves on in every tick, with a current limit. Without `current_a` it
        is `current_limit_a`.

        Keys of the telemetry: `t_s`, `encoder_rad` (of the strings since power-up), `gap_m` (by the LVDT),
        `drive_current_a`, `drive_speed_rad_per_s` (of the motor), `supply_v`. Raises ArgumentError for a value that is
        out of range.
        """
        count = _count(ticks)
        speeds = self._within("speed_rad_per_s", speed_rad_per_s, -self.speed_max_rad_per_s, self.speed_max_rad_per_s)
        given = self.current_limit_a if current_a is None else current_a
        self._core.set(speeds, self._within("current_a", given, 0.0, self.current_limit_a))
        return _unpacked(self._core.ticks(count))

    def _within(self, name: str, values: ArrayLike, low: float, high: float) -> list[float]:
        spread = self._spread(name, values)
        outside = [value for value in spread if not low <= value <= high]
        if outside:
            raise wrong(f"{name} {outside[0]} must be from {low} to {high}")
        return spread

    def copy(self) -> Plant:
        """All rigs as they are now: both then go on alike."""
        copy = Plant.__new__(Plant)
        copy.seeds, copy._core, copy._limits = self.seeds.copy(), self._core.copy(), self._limits
        return copy


def _results(results: _core.Results) -> Columns:
    names, values, why = results
    table: Array = np.array(values, dtype=float).reshape(len(why), len(names))
    return {**{name: table[:, k] for k, name in enumerate(names)}, "error": np.array(why, dtype=np.str_)}
