"""Model, table, identification, emulated rigs and rig client of a twisted-string actuator with a load-adaptive
transmission.

>>> import tsa_rig
>>> scene = tsa_rig.Scene.load("scenes/default.toml")
>>> solved = scene.mechanism().solve([1.0, 5.0, 15.0], 6.0)
>>> solved.contraction_m.shape
(3,)

All quantities are in SI units unless their name says otherwise; turns count past the half-turn pre-twist. Whatever is
refused or fails raises a `RigError`, with a `kind` for programs.
"""

from importlib.metadata import version

from ._bench import Bench, Plant, Trace
from ._errors import ArgumentError, MissingFileError, OperationError, RigError, SceneError
from ._log import read_log
from ._model import Equilibria, Linear, Looked, Mechanism, Scene, Table
from ._rig import Config, Motion, Rig
from ._tools import budget, identify, published

__version__ = version("tsa-rig")

__all__ = [
    "ArgumentError",
    "Bench",
    "Config",
    "Equilibria",
    "Linear",
    "Looked",
    "Mechanism",
    "MissingFileError",
    "Motion",
    "OperationError",
    "Plant",
    "Rig",
    "RigError",
    "Scene",
    "SceneError",
    "Table",
    "Trace",
    "budget",
    "identify",
    "published",
    "read_log",
]
