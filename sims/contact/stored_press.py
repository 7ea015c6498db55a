"""Solved states of one layer: kept in this process and on disk, solved where they are in neither."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib.metadata import version

from sims.contact.profiles import UnitPress
from sims.contact.store import entry_key, read_entry, write_entry

RECIPE = 9
"""Version of the solver behind stored solutions. Raise it when results change."""

_SOLVED: dict[str, UnitPress] = {}
"""Solutions of this process by key; each is a pure function of its key."""


@cache
def _mujoco_version() -> str:
    """Looked up once: the installed package's record is read from disk."""
    return version("mujoco")


def _solve(
    layer: float, mesh_size: float, depths: tuple[float, ...], on_step: Callable[[float], None] | None
) -> UnitPress:
    """Run MuJoCo; imported here so that stored solutions need no solver."""
    from sims.contact.unit_press import solve_unit_press

    return solve_unit_press(layer, mesh_size, depths, on_step)


def stored_press(
    layer: float,
    mesh_size: float,
    depths: tuple[float, ...],
    on_step: Callable[[float], None] | None = None,
) -> tuple[UnitPress, tuple[str, ...]]:
    """The solved states of a layer, with notes on what the user should know.

    Parameters
    ----------
    layer, mesh_size : elastic depth, node spacing under the tip [tip radii]
    depths : increasing depths to solve [tip radii]
    on_step : called with the fraction done while solving

    Raises
    ------
    ContactSolveError : a state fails its checks
    """
    layer, mesh_size = round(layer, 9), round(mesh_size, 9)
    inputs = {
        "layer": layer,
        "mesh": mesh_size,
        "depths": depths,
        "recipe": RECIPE,
        "mujoco": _mujoco_version(),
    }
    key = entry_key(inputs)
    notes: tuple[str, ...] = ()
    if key not in _SOLVED:
        press = read_entry(key)
        if press is None:
            press = _solve(layer, mesh_size, depths, on_step)
            note = write_entry(key, press)
            notes = (note,) if note else ()
        _SOLVED[key] = press
    return _SOLVED[key], notes
