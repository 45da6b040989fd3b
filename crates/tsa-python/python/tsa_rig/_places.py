"""Where programs and scenes are: in this package, if it was installed from a complete wheel, else in the checkout."""

from __future__ import annotations

import sys
from os import PathLike, fspath
from pathlib import Path

from ._errors import of_kind

FilePath = str | PathLike[str]

DEFAULT_SCENE = "scenes/default.toml"
"""The scene of a rig that is given none."""

_OWN = Path(__file__).resolve().parent / "data"
"""What a complete wheel carries: `bin`, `firmware`, `scenes` and licences."""

_SUFFIX = ".exe" if sys.platform == "win32" else ""


def scene(path: FilePath) -> Path:
    """A scene file: this path, or the file of this relative path in the package or in a folder above the present one.

    Raises MissingFileError (a FileNotFoundError) if none is there.
    """
    given = Path(path)
    places = (given, _OWN / given, *(folder / given for folder in Path.cwd().parents))
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise of_kind("no-file", f"scene {fspath(path)} is not there")
    return found


def _folders(near: Path) -> list[Path]:
    """Folders of programs: the package's own, and those of the checkout that holds a path or the present folder."""
    starts = (near.resolve(), Path.cwd().resolve() / "here")
    built = [folder / "target" / "release" for start in starts for folder in start.parents]
    return [_OWN / "bin", *built]


def program(name: str, near: FilePath, folder: FilePath | None = None) -> Path:
    """A program in a given folder, in the package, or in the checkout that holds a path or the present folder.

    Raises MissingFileError (a FileNotFoundError) if it is in none of them.
    """
    folders = [Path(folder)] if folder is not None else _folders(Path(near))
    found = next((place / f"{name}{_SUFFIX}" for place in folders if (place / f"{name}{_SUFFIX}").is_file()), None)
    if found is None:
        where = f"in {folders[0]}" if folder is not None else "built: run `cargo xtask build` in the checkout"
        raise of_kind("no-file", f"{name} is not {where}")
    return found
