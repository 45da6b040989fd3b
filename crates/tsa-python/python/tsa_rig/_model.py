"""Scenes, equilibria and tables."""

from __future__ import annotations

import json
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import SceneError, wrong
from ._places import scene as _scene

Array = NDArray[np.float64]

STANDARD_GRAVITY = 9.80665
"""Standard gravity (m/s², CODATA)."""


def numbers(name: str, values: ArrayLike) -> Array:
    """An array of numbers; raises ArgumentError, naming it, for anything else."""
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise wrong(f"{name}: {error}") from None


def seed(name: str, value: Any) -> int:
    """A seed; raises ArgumentError, naming it, for anything else."""
    try:
        whole = operator.index(value)
    except TypeError as error:
        raise wrong(f"{name}: {error}") from None
    if not 0 <= whole < 2**64:
        raise wrong(f"{name} {whole} must be a whole number from 0 to 2^64 - 1")
    return whole


def plant_changes(plant: Mapping[str, object] | None) -> list[str]:
    """Changes of a plant as the tools take them."""
    if not isinstance(plant, (Mapping, type(None))):
        raise wrong(f"plant {plant!r} must be a mapping, such as {{'load': '0.5kg'}}")
    return [f"{key}={value}" for key, value in (plant or {}).items()]


def _plain(value: object) -> object:
    """What JSON has in place of a number or an array of numpy."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise wrong(f"{value!r} cannot stand in a scene")


def _columns(
    solve: Callable[[Array, Array], _core.Columns], first: tuple[str, ArrayLike], second: tuple[str, ArrayLike]
) -> tuple[Array, Array, list[Array], NDArray[np.str_]]:
    """Two named arguments broadcast, the columns of their answers, and the errors, all of one shape."""
    given = [numbers(*first), numbers(*second)]
    try:
        ones, others = np.broadcast_arrays(*given)
    except ValueError:
        shapes = " and ".join(f"{name} of shape {array.shape}" for (name, _), array in zip((first, second), given))
        raise wrong(f"{shapes} do not broadcast against each other") from None
    rows, refused = solve(*(np.ascontiguousarray(a.ravel()) for a in (ones, others)))
    why = dict(refused)
    error = np.array([why.get(k, "") for k in range(ones.size)], dtype=np.str_) if why else np.full(ones.size, "")
    shape = ones.shape
    return ones.copy(), others.copy(), [row.reshape(shape) for row in rows], error.reshape(shape)


@dataclass(frozen=True, eq=False)
class Equilibria:
    """Equilibria of the full model. Arrays of one shape.

    Where a state is refused, numbers are NaN and `error` says why.
    """

    load_n: Array
    """Load (N)."""
    turns: Array
    """Turns past the half-turn pre-twist."""
    alpha_rad: Array
    """Helix angle (rad)."""
    X_m: Array
    """Distance between the strings' attachments (m)."""
    D_m: Array
    """Distance between the rods' tips (m)."""
    w_m: Array
    """Deflection of a rod (m)."""
    r_m: Array
    """Radius of the twisted pair (m)."""
    tension_n: Array
    """Tension of one string (N)."""
    bending_strain: Array
    """Bending strain of the rods at the clamp."""
    contraction_m: Array
    """Contraction since the half-turn pre-twist at this load (m)."""
    load_sag_m: Array
    """How far the load hangs below the free mechanism at the half-turn pre-twist (m)."""
    tr_rad_per_m: Array
    """Transmission ratio (rad/m), infinite at zero twist."""
    gap_m: Array
    """Gap between the two clamps (m)."""
    dgap_dtwist_m_per_rad: Array
    """Derivative of the gap by the twist at constant load (m/rad)."""
    dgap_dload_m_per_n: Array
    """Derivative of the gap by the load at constant twist (m/N)."""
    error: NDArray[np.str_]
    """Why a state was refused; empty where it was not."""
    _torque: Callable[[Array, Array], _core.Columns] | None = field(repr=False, compare=False)

    @cached_property
    def torque_nm(self) -> Array:
        """Torque of the strings towards zero twist (N m), without friction; computed when it is first asked for, in ten
        times the time of the rest.

        It is the conservative one, T = −∂/∂θ ∫₀ᶠ G dF with the gap G, twist θ and load F, so that what the motor gives
        the load takes. The paper's relation, which does not conserve energy, differs from it
        (docs/explanation/model.md, section 4). NaN also where a lighter load has no equilibrium at this twist, or one
        that is about to run away, beyond about 5.7 turns in the default scene: the integral has no beginning there.
        Below 0.3 N it is proportional to the load.
        """
        assert self._torque is not None, "it was computed before it was pickled"
        _, _, (torque,), _ = _columns(self._torque, ("load_n", self.load_n), ("turns", self.turns))
        return np.where(self.error == "", torque, np.nan)

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "torque_nm": self.torque_nm, "_torque": None}


@dataclass(frozen=True, eq=False)
class Looked:
    """The board's own answers (its f32 as f64). Arrays of one shape; outside the table NaN, and `error` says why."""

    load_n: Array
    """Load (N)."""
    turns: Array
    """Turns past the half-turn pre-twist."""
    contraction_m: Array
    """Contraction since the half-turn pre-twist at this load (m)."""
    gap_m: Array
    """Gap between the two clamps (m)."""
    tr_rad_per_m: Array
    """Transmission ratio (rad/m)."""
    dgap_dload_m_per_n: Array
    """Derivative of the gap by the load at constant twist (m/N)."""
    error: NDArray[np.str_]
    """Why a point was refused; empty where it was not."""


class Linear(NamedTuple):
    """A linear state-space model, x' = A x + B u and y = C x + D u, about an equilibrium at rest.

    x is the load's position (m, up) and speed (m/s), u the twist of the strings (rad), y the load's position (m); all
    are deviations from the equilibrium.
    """

    A: Array
    """Shape (2, 2): 1/s and 1/s²."""
    B: Array
    """Shape (2, 1): m/(s rad) and m/(s² rad)."""
    C: Array
    """Shape (1, 2)."""
    D: Array
    """Shape (1, 1)."""


# The rows that the native part answers with, in its order.
_SOLVED = [f.name for f in fields(Equilibria)][2:-2]
_LOOKED_UP = [f.name for f in fields(Looked)][2:-1]


class Mechanism:
    """The mechanism of a scene, solved by the full model in double precision on all cores."""

    def __init__(self, core: _core.Scene) -> None:
        self._core = core

    def solve(self, load_n: ArrayLike, turns: ArrayLike) -> Equilibria:
        """Equilibria at loads (N) and turns past the half-turn pre-twist, which broadcast against each other.

        Raises ArgumentError if they do not broadcast. A state that the model refuses is NaN, with its reason in
        `error`.
        """
        loads, all_turns, columns, error = _columns(self._core.solve, ("load_n", load_n), ("turns", turns))
        named = dict(zip(_SOLVED, columns))
        return Equilibria(**named, load_n=loads, turns=all_turns, error=error, _torque=self._core.torque)

    def force(self, gap_m: ArrayLike, turns: ArrayLike) -> Equilibria:
        """Which load holds a gap (m) at turns past the half-turn pre-twist? Arrays that broadcast.

        The answer is the whole equilibrium: `load_n` is the load (N), and `1 / dgap_dload_m_per_n` the stiffness (N/m).
        Where no load holds the gap, `load_n` and the other numbers are NaN, and `error` has the reason. Raises
        ArgumentError if the arrays do not broadcast.
        """
        _, all_turns, (loads,), error = _columns(self._core.force, ("gap_m", gap_m), ("turns", turns))
        return self._held(loads, all_turns, error)

    def twist(self, load_n: ArrayLike, gap_m: ArrayLike) -> Equilibria:
        """Which twist holds a gap (m) under a load (N)? Arrays that broadcast.

        The answer is the whole equilibrium, from zero twist (half a turn before the pre-twist) up: `turns` are past the
        half-turn pre-twist. Where no twist holds the gap, `turns` and the other numbers are NaN, and `error` has the
        reason. Raises ArgumentError if the arrays do not broadcast.
        """
        loads, _, (all_turns,), error = _columns(self._core.twist, ("load_n", load_n), ("gap_m", gap_m))
        return self._held(loads, all_turns, error)

    def linearise(
        self, load_n: float, turns: float, mass_kg: float | None = None, damping_n_s_per_m: float = 0.0
    ) -> Linear:
        """The motion of a load about its equilibrium, while the motor holds or moves the twist.

        `load_n` (N) and `turns`, past the half-turn pre-twist, are the equilibrium's. `mass_kg` is what moves with the
        load; without it, the mass that weighs `load_n`. `damping_n_s_per_m` is the viscous damping of rail, rods and
        strings together. The stiffness 1 / (∂G/∂F) and the ratio 1/TR = −∂G/∂θ are the model's exact derivatives.
        Coulomb friction, hysteresis and the motor are not in it.

        `control.ss(*linear)` is the system in python-control. Its gain at rest is 1/TR. Raises ArgumentError, naming
        the parameter, for a number that is out of range and for a state that the model refuses.
        """
        given = {"load_n": load_n, "turns": turns, "damping_n_s_per_m": damping_n_s_per_m}
        given |= {} if mass_kg is None else {"mass_kg": mass_kg}
        number = {name: numbers(name, value) for name, value in given.items()}
        for name, value in number.items():
            if value.shape != () or not np.isfinite(value):
                raise wrong(f"{name} {given[name]} must be one finite number")
        held = self.solve(load_n, turns)
        if held.error:
            raise wrong(f"load_n {load_n}, turns {turns}: {held.error}")
        mass, damping = number.get("mass_kg", number["load_n"] / STANDARD_GRAVITY), number["damping_n_s_per_m"]
        if mass <= 0.0:
            raise wrong(f"mass_kg {mass} must be above 0")
        if damping < 0.0:
            raise wrong(f"damping_n_s_per_m {damping} must be at least 0")
        stiffness = 1.0 / held.dgap_dload_m_per_n
        a = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
        b = np.array([[0.0], [-stiffness * held.dgap_dtwist_m_per_rad / mass]])
        return Linear(a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1)))

    def _held(self, load_n: Array, turns: Array, error: NDArray[np.str_]) -> Equilibria:
        solved = self.solve(load_n, turns)
        return replace(solved, error=np.where(error != "", error, solved.error))


class Table:
    """The table that the firmware carries, with the board's own lookup in single precision."""

    def __init__(self, core: _core.Table) -> None:
        self._core = core

    @property
    def bytes(self) -> int:
        """Size of the table's numbers on the board (bytes)."""
        return self._core.bytes

    @property
    def contraction_error_m(self) -> float:
        """Largest error of a contraction against the full model (m)."""
        return self._core.errors[0]

    @property
    def tr_relative_error(self) -> float:
        """Largest relative error of the transmission ratio against the full model."""
        return self._core.errors[1]

    def lookup(self, load_n: ArrayLike, turns: ArrayLike) -> Looked:
        """What the board answers at loads (N) and turns past the half-turn pre-twist, which broadcast."""
        loads, all_turns, columns, error = _columns(self._core.lookup, ("load_n", load_n), ("turns", turns))
        return Looked(**dict(zip(_LOOKED_UP, columns)), load_n=loads, turns=all_turns, error=error)


def _place(keys: dict[str, Any], name: str) -> tuple[str, str]:
    """Section and key of a constant by its name, with or without the section."""
    constants = {(section, key) for section, table in keys.items() if isinstance(table, dict) for key in table}
    found = [place for place in constants if name in (place[1], ".".join(place))]
    if len(found) == 1:
        return found[0]
    if found:
        raise wrong(f"`{name}` is ambiguous: " + ", ".join(sorted(".".join(place) for place in found)))
    known = ", ".join(sorted(".".join(place) for place in constants))
    raise wrong(f"a scene has no constant `{name}`; it has {known}")


class Scene:
    """What one rig and one task need: constants, load range, travel, accuracy."""

    def __init__(self, core: _core.Scene) -> None:
        self._core = core

    def __reduce__(self) -> tuple[Callable[[dict[str, Any]], Scene], tuple[dict[str, Any]]]:
        return Scene.from_dict, (self.as_dict(),)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Scene:
        """From a scene file (TOML): a path, or the name of a scene of this package such as `scenes/default.toml`.

        Raises MissingFileError (a FileNotFoundError) if there is none, and SceneError, naming the key, if it is not
        valid.
        """
        return cls(_core.Scene.load(_scene(path)))

    @classmethod
    def parse(cls, text: str) -> Scene:
        """The same from the text of such a file."""
        return cls(_core.Scene.parse(text))

    @classmethod
    def from_dict(cls, keys: dict[str, Any]) -> Scene:
        """From all keys, as `as_dict` gives them. Raises SceneError, naming the key, if they are not valid."""
        return cls(_core.Scene.from_json(json.dumps(keys, default=_plain)))

    def with_constants(self, **values: Any) -> Scene:
        """The same scene with other constants, named as in the scene file, for example `rod_radius_m=0.0004`.

        A key of a section can be given with it too: `**{"rig.gear_ratio": [30, 1]}`. The measured correction of a scene
        belongs to the constants that it was measured with, and is left out if one of `geometry`, `string` or `material`
        changes. Raises ArgumentError for an unknown name, and SceneError for a value that no rig can have; both name
        it.
        """
        keys = self.as_dict()
        for name, value in values.items():
            section, key = _place(keys, name)
            keys[section][key] = value
            if section in ("geometry", "string", "material"):
                keys.pop("correction", None)
        try:
            return Scene.from_dict(keys)
        except SceneError as error:
            given = ", ".join(f"{name} = {value}" for name, value in values.items())
            raise SceneError(f"the scene with {given}: {error}", error.kind) from None

    def mechanism(self) -> Mechanism:
        """The mechanism with the scene's constants."""
        return Mechanism(self._core)

    def table(self) -> Table:
        """The table for the scene's envelope and accuracy. Raises SceneError if none reaches them."""
        return Table(self._core.table())

    def as_dict(self) -> dict[str, Any]:
        """All keys of the scene."""
        keys: dict[str, Any] = json.loads(self._core.json())
        return keys
