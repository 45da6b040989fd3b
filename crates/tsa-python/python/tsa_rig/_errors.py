"""What is refused or fails: every exception is a `RigError` with a `kind`."""

from __future__ import annotations

from typing import Any


class RigError(Exception):
    """Anything that this package refuses, or that fails.

    `kind` is a short stable word for programs; the message is for people.
    """

    kind: str

    def __init__(self, message: str, kind: str = "failed") -> None:
        super().__init__(message)
        self.kind = kind

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.kind)


class ArgumentError(RigError, ValueError):
    """An argument that no call can have, which the message names. Kind `bad-request`."""


class SceneError(RigError, ValueError):
    """A scene that is not valid, by the key in the message, or that has no table. Kind `scene`."""


class MissingFileError(RigError, FileNotFoundError):
    """A file that is not there, or a program that is not built. Kind `no-file`."""


class OperationError(RigError, RuntimeError):
    """An operation that was refused or has failed.

    Kinds, as in `crates/rigctl/serve.md`: `refused` (by the board), `fault`, `estop`, `homing-failed` (what ended the
    motion), `stopped` (by a stop), `no-reply`, `board-silent`; also `board-reset` (the board has started again: its
    position is lost), `closed` (the rig is closed), `timeout` (the motion goes on) and `failed` (anything else).
    """


_CLASSES: dict[str, type[RigError]] = {
    "bad-request": ArgumentError,
    "scene": SceneError,
    "no-file": MissingFileError,
}


def of_kind(kind: str, message: str) -> RigError:
    """The exception of a kind."""
    return _CLASSES.get(kind, OperationError)(message, kind)


def wrong(message: str) -> ArgumentError:
    """A wrong argument."""
    return ArgumentError(message, "bad-request")
