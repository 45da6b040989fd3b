"""A client of the board, emulated or real."""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core

_EMULATOR = Path("target") / "release" / "rig-emulator"


def _programs(scene: Path) -> Path | None:
    """The folder of the emulator in the checkout that holds the scene or the present folder."""
    for start in (scene.resolve(), Path.cwd().resolve() / "here"):
        for folder in start.parents:
            if (folder / _EMULATOR).exists():
                return (folder / _EMULATOR).parent
    return None


class Rig:
    """A board with its rig: `sim` is an emulated one, `auto` the one behind the only ST-LINK, anything else a
    serial device such as `/dev/ttyACM0`.

    As a context manager it stops the motion on the way out, also after an exception or Ctrl-C. The strings keep the
    load as long as the drive has power. Time of an emulated rig passes only in `home`, `move`, `wait` and `stop`.

    Raises RuntimeError if there is no board, or if its table is for another scene.
    """

    def __init__(
        self,
        port: str = "sim",
        *,
        scene: str | PathLike[str] = "scenes/default.toml",
        rig: str = "nominal",
        seed: int = 1,
        plant: Mapping[str, object] | None = None,
        programs: str | PathLike[str] | None = None,
    ) -> None:
        """`rig` (ideal, nominal, hard), `seed` and `plant` (keys of docs/reference/simulator.md) are of an emulated
        rig; `programs` is the folder of `rig-emulator`, which is looked for in the checkout otherwise."""
        changes = [f"{key}={value}" for key, value in (plant or {}).items()]
        folder = Path(programs) if programs is not None else _programs(Path(scene))
        if port == "sim" and folder is None:
            raise RuntimeError("the emulator is not built: run `cargo xtask build` in the checkout, or give `programs`")
        self._board = _core.Board(port, scene, rig, seed, changes, folder)

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def home(self, load_n: float | None = None) -> dict[str, Any]:
        """Finds zero twist and weighs the load, or takes `load_n` for it (N). Keys as `rigctl home --json`."""
        return dict(json.loads(self._board.home(load_n)))

    def move(self, target_m: float, speed: float = 0.002, load_n: float | None = None) -> dict[str, Any]:
        """Brings the load to a position (m) at a speed (m/s) at most. Keys as `rigctl move --json`.

        `math.inf` is as fast as the motor allows under this load.

        Raises RuntimeError with the board's refusal, or the fault that ended the move.
        """
        return dict(json.loads(self._board.move_to(target_m, speed, load_n)))

    def track(
        self, times: ArrayLike, positions: ArrayLike, speeds: ArrayLike | None = None
    ) -> dict[str, Any]:
        """Follows positions (m) at times (s), with these speeds (m/s). Keys as `rigctl track --json`.

        The load first moves to the first position. Times count from then; between them the trajectory is a cubic.
        Without speeds it begins and ends at rest. The three lists have one shape, (n,), with at least two numbers.
        Raises ValueError for lists that are no trajectory, and RuntimeError with the board's refusal or why it ended
        the stream; the load is then held.
        """
        lists = [np.asarray(values, dtype=float) for values in (times, positions)]
        lists += [] if speeds is None else [np.asarray(speeds, dtype=float)]
        if any(values.ndim != 1 for values in lists):
            raise ValueError("times, positions and speeds must be lists of numbers")
        times_s, positions_m, *given = (values.tolist() for values in lists)
        return dict(json.loads(self._board.track(times_s, positions_m, given[0] if given else None)))

    def wait(self, seconds: float) -> None:
        """Lets time pass (s)."""
        self._board.wait(seconds)

    def stop(self) -> None:
        """Ramps down whatever moves."""
        self._board.stop()

    def clear(self) -> None:
        """Clears the faults whose causes are gone."""
        self._board.clear()

    def set_plant(self, **changes: object) -> None:
        """Changes an emulated rig, for example `set_plant(load="0.8kg")`."""
        for key, value in changes.items():
            self._board.plant(f"{key}={value}")

    def telemetry(self) -> dict[str, NDArray[Any]]:
        """Everything that the board has told since the connection: one array a key, NaN where it knew nothing.

        Keys and units are those of `rigctl record`; words such as `state` are arrays of strings.
        """
        rows = json.loads(self._board.rows())
        return {key: _array([row[key] for row in rows]) for key in (rows[0] if rows else {})}

    def close(self) -> None:
        """Stops the motion and ends the conversation. Further calls raise RuntimeError."""
        self._board.close()


def _array(values: list[Any]) -> NDArray[Any]:
    if any(isinstance(value, str) for value in values):
        return np.array([value or "" for value in values], dtype=np.str_)
    return np.array([np.nan if value is None else value for value in values], dtype=float)
