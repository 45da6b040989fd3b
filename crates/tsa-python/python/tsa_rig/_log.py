"""Recorded logs of `rigctl record`, `sweep` and the others."""

import csv
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from ._errors import of_kind, wrong

FORMAT = "# format = tsa-log"
END = "# end rows = "
WORDS = frozenset({"state", "fault", "faults", "limit", "doubts", "load_at_range_end", "homing_failure"})


def read_log(path: str | PathLike[str]) -> dict[str, NDArray[np.float64] | NDArray[np.object_]]:
    """The rows of a log: an array for each column, named as the telemetry, in SI units and in the order of the file.

    Numbers are float64, NaN where a value is not known; words are str, None where there is none.
    `pandas.DataFrame(read_log(path))` is the table, and its `to_parquet` writes Parquet.

    Raises ArgumentError if the file is no log, or was cut short, and MissingFileError if it is not there.
    """
    try:
        with open(path, encoding="utf-8", newline="") as stream:
            lines = stream.read().splitlines()
    except FileNotFoundError:
        raise of_kind("no-file", f"{path!s}: there is no such log") from None
    except (IsADirectoryError, UnicodeDecodeError) as error:
        raise wrong(f"{path!s}: not a log of this tool: {error}") from None
    if not lines or not lines[0].startswith(FORMAT):
        raise wrong(f"{path}: not a log of this tool: its first line is no `{FORMAT} …`")
    names, *rows = list(csv.reader(line for line in lines if line and not line.startswith("#"))) or [[]]
    ends = [line.removeprefix(END) for line in lines if line.startswith(END)]
    if ends != [str(len(rows))] or any(len(row) != len(names) for row in rows):
        raise wrong(f"{path}: cut short after {len(rows)} rows")
    def number(name: str, cell: str) -> float:
        try:
            return float(cell) if cell else np.nan
        except ValueError:
            raise wrong(f"{path!s}: {name} `{cell}` is not a number") from None

    columns = zip(*rows, strict=True) if rows else [()] * len(names)
    return {
        name: np.array([cell or None for cell in cells], dtype=np.object_)
        if name in WORDS
        else np.array([number(name, cell) for cell in cells], dtype=np.float64)
        for name, cells in zip(names, columns, strict=True)
    }
