"""A client of the board, emulated or real."""

from __future__ import annotations

import asyncio
import json
import math
import threading
from collections.abc import AsyncIterator, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from os import fspath
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import OperationError, of_kind, wrong
from ._log import WORDS
from ._model import numbers, plant_changes
from ._model import seed as _seed
from ._places import DEFAULT_SCENE, FilePath, program
from ._places import scene as _scene

Telemetry = dict[str, NDArray[Any]]
Object = dict[str, Any]


class Motion:
    """A move that goes on while the program does other things."""

    def __init__(self, core: _core.Motion) -> None:
        self._core = core

    @property
    def done(self) -> bool:
        """Whether it has ended, at its target or not."""
        return self._core.done

    def wait(self, timeout: float | None = None) -> Object:
        """Waits for its end; keys as those of `Rig.move`.

        Raises OperationError: of kind `timeout` after `timeout` seconds of this machine's clock (the motion goes on),
        else with the board's refusal or what ended the move. Ctrl-C stops the motion.
        """
        ended = self._core.wait(timeout)
        if ended is None:
            raise of_kind("timeout", f"the move has not ended after {timeout} s, and goes on")
        return dict(json.loads(ended))

    def __await__(self) -> Generator[Any, None, Object]:
        """`await motion` is `wait` in a thread of asyncio: other tasks go on. If the task is cancelled, the motion goes
        on until `Rig.stop` or the end of the `with` block."""
        return asyncio.to_thread(self.wait).__await__()


class Config:
    """The settings of a board, which it keeps in its flash. See docs/how-to/configure.md."""

    def __init__(self, board: _core.Board) -> None:
        self._board = board

    @overload
    def get(self) -> dict[str, Object]: ...

    @overload
    def get(self, name: str) -> Object: ...

    def get(self, name: str | None = None) -> Object | dict[str, Object]:
        """A setting: `value`, `unit`, `default`, `min`, `max`, `kept`; without a name all of them, by their names.

        Raises ArgumentError, naming all settings, for an unknown one.
        """
        found = [json.loads(line) for line in self._board.config_get(name).splitlines()]
        return dict(found[0]) if name is not None else {setting.pop("name"): setting for setting in found}

    def set(self, name: str, value: float | str) -> Object:
        """Changes a setting and keeps it: a number in the setting's own unit, or text with a unit such as `"0.1mm"`.

        Keys of the answer: `name`, `value`, `unit`, `before`, `kept`, `unhomed` (the position is lost: home again).
        Raises ArgumentError for an unknown name or a value of another kind, OperationError with the board's refusal.
        """
        return dict(json.loads(self._board.config_set(name, str(value))))

    def backup(self, file: FilePath) -> Object:
        """Writes all settings to a file (TOML). Keys of the answer: `file`, `settings`."""
        return dict(json.loads(self._board.config_backup(fspath(file))))

    def restore(self, file: FilePath, force: bool = False) -> Object:
        """Sets all settings from such a file, or from the head of a log; none if anything in it is wrong.

        Settings that correct other constants than this rig's stay as they are, and the call then raises
        OperationError; `force` takes them, too. Keys of the answer: `settings`, `before`, `changed`, `dropped`,
        `unhomed`. Raises MissingFileError (a FileNotFoundError) if the file is not there.
        """
        if not Path(file).is_file():
            raise of_kind("no-file", f"file {fspath(file)} is not there")
        return dict(json.loads(self._board.config_restore(fspath(file), force)))


class Rig:
    """A board with its rig: `sim` is an emulated one, `auto` the one behind the only ST-LINK, anything else a
    serial device such as `/dev/ttyACM0`.

    As a context manager it stops the motion on the way out, also after an exception or Ctrl-C. The strings keep the
    load as long as the drive has power. Time of an emulated rig passes only in calls that say so and in a motion that
    `move(..., wait=False)` has begun. One thread at a time talks to the board: other calls wait for a motion's end,
    except `stop`, `close`, `wait`, `latest`, `rows` and `telemetry`.
    """

    config: Config
    """The board's settings."""

    scene: Path
    """The scene file that the board's table is for."""

    def __init__(
        self,
        port: str = "sim",
        *,
        scene: FilePath = DEFAULT_SCENE,
        rig: str = "nominal",
        seed: int = 1,
        plant: Mapping[str, object] | None = None,
        programs: FilePath | None = None,
        flash: FilePath | None = None,
        plant_scene: FilePath | None = None,
        plant_program: str | None = None,
        check_scene: bool = True,
    ) -> None:
        """`rig` (ideal, nominal, hard), `seed` and `plant` (keys of docs/reference/simulator.md) are of an emulated
        rig; `programs` is the folder of `rig-emulator`, which is looked for in the package and the checkout otherwise.
        An emulated board is sent the table of the scene. `check_scene=False` connects to a board whose table is for
        another scene, and leaves that table: for `make_table`.

        Also of an emulated rig, as the options of `rigctl`: `flash` is the file that keeps the board's settings and
        table from one `Rig` to the next, and is made if it is not there; `plant_scene` is the scene that the plant is
        built by, if it is not the board's; `plant_program` is a program and its arguments that stand in for mechanism
        and load.

        Raises MissingFileError (a FileNotFoundError) if a scene, the folder of `flash` or the emulator is not there,
        SceneError for a scene of a rig that cannot work, ArgumentError for a wrong `rig` or `plant` and for what only
        an emulated rig has, and OperationError if there is no board, or its table is for another scene.
        """
        changes, drawn = plant_changes(plant), _seed("seed", seed)
        emulated = {"plant": plant, "flash": flash, "plant_scene": plant_scene, "plant_program": plant_program}
        for name in (name for name, value in emulated.items() if value is not None and port != "sim"):
            raise wrong(f"{name} is of an emulated rig, not of port {port!r}")
        if flash is not None and not Path(flash).absolute().parent.is_dir():
            raise of_kind("no-file", f"flash {fspath(flash)}: its folder is not there")
        found = _scene(scene)
        of_plant = None if plant_scene is None else _scene(plant_scene)
        folder = program("rig-emulator", found, programs).parent if port == "sim" else None
        self._board = _core.Board(
            port, found, rig, drawn, changes, folder, flash, of_plant, plant_program, not check_scene
        )
        self.config, self.scene = Config(self._board), found
        self._rows: list[Object] = []
        self._reading = threading.Lock()

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def home(self, load_n: float | None = None) -> Object:
        """Finds zero twist and estimates the load, or takes `load_n` for it (N). Keys as `rigctl home --json`.

        Raises OperationError: of kind `homing-failed` with the reason, `refused`, `fault` or `estop`.
        """
        return dict(json.loads(self._board.home(load_n)))

    @overload
    def move(
        self, target_m: float, speed: float = 0.002, load_n: float | None = None, *, wait: Literal[True] = True
    ) -> Object: ...

    @overload
    def move(
        self, target_m: float, speed: float = 0.002, load_n: float | None = None, *, wait: Literal[False]
    ) -> Motion: ...

    @overload
    def move(
        self, target_m: float, speed: float = 0.002, load_n: float | None = None, *, wait: bool
    ) -> Object | Motion: ...

    def move(
        self, target_m: float, speed: float = 0.002, load_n: float | None = None, *, wait: bool = True
    ) -> Object | Motion:
        """Brings the load to a position (m) at a speed (m/s) at most. Keys as `rigctl move --json`.

        `math.inf` is as fast as the motor allows under this load. With `wait=False` it returns at once, with a
        `Motion`; time of an emulated rig then passes until the motion's end, as fast as the emulator runs.

        Raises OperationError with the board's refusal, or the fault that ended the move; with `wait=False` it is
        `Motion.wait` that raises.
        """
        if not wait:
            return Motion(self._board.begin_move(target_m, speed, load_n))
        return dict(json.loads(self._board.move_to(target_m, speed, load_n)))

    def track(
        self, times: ArrayLike, positions: ArrayLike, speeds: ArrayLike | None = None
    ) -> Object:
        """Follows positions (m) at times (s), with these speeds (m/s). Keys as `rigctl track --json`.

        The load first moves to the first position. Times count from then; between them the trajectory is a cubic.
        Without speeds it begins and ends at rest. The three lists have one shape, (n,), with at least two numbers.
        Raises ArgumentError for lists that are no trajectory, and OperationError with the board's refusal or why it
        ended the stream; the load is then held. Range, speed and acceleration are checked before anything moves, as
        `rigctl track` does: OperationError, of kind `refused`, then names the point, counted from 0.
        """
        lists = [numbers("times", times), numbers("positions", positions)]
        lists += [] if speeds is None else [numbers("speeds", speeds)]
        if any(values.ndim != 1 for values in lists):
            raise wrong("times, positions and speeds must be lists of numbers")
        times_s, positions_m, *given = (values.tolist() for values in lists)
        return dict(json.loads(self._board.track(times_s, positions_m, given[0] if given else None)))

    def jog(self, speed_rad_per_s: float, seconds: float = 1.0) -> None:
        """Turns the strings at a constant speed (rad/s of the strings, positive twists up) for a time (s), homed or
        not, then ramps down. Raises ArgumentError for a time below 0 or above 600 s, OperationError as `move`."""
        if not 0.0 <= seconds <= 600.0:
            raise wrong(f"seconds {seconds} must be from 0 to 600")
        self._board.jog(speed_rad_per_s, seconds)

    def sweep(
        self, load_n: float, out: FilePath, turns: float = 7.5, speed_rad_per_s: float = 1.308996938995747
    ) -> Object:
        """The paper's experiment: homes, turns the strings up and back, and records it in a file for `identify`.

        `load_n` is the load on the rail as weighed (N), which an emulated rig is given first; `turns` are past the
        half-turn pre-twist; the speed is the strings' (rad/s; 12.5 rpm without one). Keys as `rigctl sweep --json`.
        Raises OperationError, naming the parameter, for one that the board's table does not cover, and as `home`.
        """
        return dict(json.loads(self._board.sweep(load_n, turns, speed_rad_per_s, fspath(out))))

    def calibrate(
        self,
        what: Literal["lvdt", "zero"],
        *,
        gap_m: float | None = None,
        point: tuple[float, float] | None = None,
        points: FilePath | None = None,
        gauge_error_m: float = 20e-6,
    ) -> Object:
        """Calibrates the LVDT, or makes the present position zero (`"zero"`); the board keeps the result.

        For the LVDT `gap_m` is the true gap now, by callipers (m), and gives the offset; with `point`, a gap that was
        measured before and the sensor's uncalibrated reading there (both m), also the gain. `points` is a file with
        the columns gap_m and sensor_m of 2 to 11 places; `gauge_error_m` is the 90 % uncertainty of its gaps (m).
        Without any of them the call only reads: `gap_m`, `sensor_m`. Keys as `rigctl calibrate --json`.

        Raises ArgumentError for arguments that do not go together, OperationError for points that are no calibration
        and for a position that is not known.
        """
        if what not in ("lvdt", "zero"):
            raise wrong(f"what {what!r} must be 'lvdt' or 'zero'")
        if what == "zero":
            if gap_m is not None or point is not None or points is not None:
                raise wrong("gap_m, point and points are of the LVDT, not of zero")
            return dict(json.loads(self._board.calibrate_zero()))
        if gap_m is not None and points is not None:
            raise wrong("points and gap_m do not go together")
        if point is not None and gap_m is None:
            raise wrong("point needs gap_m, the true gap now")
        if points is not None and not Path(points).is_file():
            raise of_kind("no-file", f"points: file {fspath(points)} is not there")
        where = None if points is None else fspath(points)
        if gap_m is not None:
            gap_m = float(_finite("gap_m", gap_m, ()))
        if point is not None:
            first, second = _finite("point", point, (2,))
            point = float(first), float(second)
        return dict(json.loads(self._board.calibrate_lvdt(gap_m, point, where, gauge_error_m)))

    def make_table(self, scene: FilePath | None = None) -> Object:
        """Fits the table of a scene (of this rig's own without one) and sends it to the board, which checks and keeps
        it. Home again afterwards.

        Keys: `scene_hash`, `bytes`, `contraction_error_m`, `tr_relative_error`, `kept`. Raises MissingFileError,
        SceneError, and OperationError with the board's refusal or if `[rig]` of the scene is another rig's.
        """
        of = self.scene if scene is None else _scene(scene)
        made = dict(json.loads(self._board.make_table(of)))
        self.scene = of
        return made

    def status(self) -> Object:
        """The board's identity, state and readings, after listening for a second. Keys as `rigctl status --json`."""
        return dict(json.loads(self._board.status()))

    def doctor(self, turn: bool = False, home: bool = False) -> Object:
        """Checks board and rig: `ok`, `port`, `rig` and the list `checks`, each with `name`, `ok`, `seen`, `advice`.

        As `rigctl doctor --json`, after listening for two seconds. `turn` turns the strings by a hundredth of a turn
        each way first, to compare the directions of motor and encoders; `home` homes, and turns them by a third of a
        turn and back. What is not well is in the checks; OperationError is raised if the board does not answer.
        """
        return dict(json.loads(self._board.doctor(turn, home)))

    def record(self, file: FilePath, seconds: float) -> Object:
        """Lets time pass (s) and writes a log of it. Keys of the answer and errors are those of `recording`.

        Raises ArgumentError for a time that is not above 0 and finite.
        """
        if not 0.0 < seconds < math.inf:
            raise wrong(f"seconds {seconds} must be above 0 and finite")
        with self.recording(file) as log:
            self.wait(seconds)
        return log

    @contextmanager
    def recording(self, file: FilePath) -> Iterator[Object]:
        """Writes a log of what passes in a `with` block, as `rigctl record` does: telemetry, requests and events.

        `read_log`, `rigctl replay` and `rigctl export` read it. The value of `with` is a dictionary that has `rows`,
        `lost_rows` and `lost_frames` after the block. An exception that ends the block is named at the log's end.
        Raises OperationError, naming the file, if it cannot be written.
        """
        recording, log = self._board.record(fspath(file)), Object()
        try:
            yield log
        except BaseException as error:
            with suppress(OperationError):
                recording.end(f"{type(error).__name__}: {error}")
            raise
        log.update(json.loads(recording.end(None)))

    def wait(self, seconds: float) -> None:
        """Lets time pass (s), also that of a motion which goes on.

        Raises ArgumentError for a time below 0 or one that is not finite.
        """
        if not 0.0 <= seconds < math.inf:
            raise wrong(f"seconds {seconds} must be at least 0 and finite")
        self._board.wait(seconds)

    def stop(self) -> None:
        """Ramps down whatever moves, also a motion that another thread waits for.

        Raises OperationError of kind `board-silent` if the board does not acknowledge it: the motor may still turn.
        """
        self._board.stop()

    def clear(self) -> None:
        """Clears the faults whose causes are gone. Raises OperationError of kind `refused` if one remains."""
        self._board.clear()

    def set_plant(self, **changes: object) -> None:
        """Changes an emulated rig, for example `set_plant(load="0.8kg")`. Raises ArgumentError, naming the key."""
        for key, value in changes.items():
            self._board.plant(f"{key}={value}")

    def _all(self) -> list[Object]:
        with self._reading:
            self._rows += json.loads(self._board.rows(len(self._rows)))
        return self._rows

    def telemetry(self) -> Telemetry:
        """Everything that the board has told since the connection: one array of shape (rows,) a key, NaN where it knew
        nothing.

        Keys and units are those of `rigctl record`; words such as `state` are strings, empty where there is none.
        """
        rows = self._all()
        return {key: _array(key, [row[key] for row in rows]) for key in (rows[0] if rows else {})}

    def latest(self) -> Object:
        """The newest row of telemetry: keys as in `telemetry`, None where the board knows nothing.

        Lets 10 ms pass if nothing else does.
        """
        self.wait(0.01)
        return dict(self._all()[-1])

    def rows(self, seconds: float | None = None) -> Iterator[Object]:
        """Each row of telemetry from now on as it comes, 100 a second, as `latest` gives it.

        Time passes while the next one is waited for. It ends after `seconds`, without them never.
        """
        if seconds is not None and math.isnan(seconds):
            raise wrong("seconds is not a number")
        count, start_s = len(self._all()), None
        while True:
            if len(self._all()) == count:
                self.wait(0.01)
                continue
            row = self._rows[count]
            count += 1
            start_s = row["t_s"] if start_s is None else start_s
            if seconds is not None and row["t_s"] >= start_s + seconds:
                return
            yield dict(row)

    async def stream(self, seconds: float | None = None) -> AsyncIterator[Object]:
        """`rows` for `async for`: each next row is waited for in a thread of asyncio, while other tasks go on.

        On an emulated rig that no motion leads time passes as fast as rows are taken.
        """
        rows = self.rows(seconds)
        while (row := await asyncio.to_thread(next, rows, None)) is not None:
            yield row

    def close(self) -> None:
        """Stops the motion and ends the conversation. Further calls raise OperationError of kind `closed`."""
        self._board.close()


def _finite(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    found = numbers(name, values)
    if found.shape != shape or not np.all(np.isfinite(found)):
        raise wrong(f"{name} {values!r} must be {'two finite numbers' if shape else 'one finite number'}")
    return found


def _array(name: str, values: list[Any]) -> NDArray[Any]:
    if name in WORDS:
        return np.array([value or "" for value in values], dtype=np.str_)
    return np.array([np.nan if value is None else value for value in values], dtype=float)
