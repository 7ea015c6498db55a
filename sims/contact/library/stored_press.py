"""Solved states of one layer: kept in this process and on disk, solved where they are in neither."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version

from sims.contact.library.profiles import UnitPress
from sims.contact.library.store import entry_key, read_entry, write_entry
from sims.contact.scope import WALL_RADIUS
from sims.contact.tip import HEMISPHERE, TipOutline

RECIPE = 13
"""Version of the solver behind stored solutions. Raise it when results change."""

_SOLVED: dict[str, UnitPress] = {}
"""Solutions of this process by key; each is a pure function of its key."""


@cache
def _mujoco_version() -> str:
    """Looked up once: the installed package's record is read from disk."""
    return version("mujoco")


@dataclass(frozen=True, kw_only=True)
class PressInputs:
    """Everything that a solution depends on; lengths in tip radii.

    Attributes
    ----------
    layer : elastic depth
    mesh_size : node spacing under the tip
    depths : increasing depths to solve
    poisson_ratio : of the layer [-]
    tip : what presses
    wall_radius : of the bonded wall
    crown : tip radius over the radius of the top's sphere; 0 is flat [-]
    """

    layer: float
    mesh_size: float
    depths: tuple[float, ...]
    poisson_ratio: float
    tip: TipOutline = HEMISPHERE
    wall_radius: float = WALL_RADIUS
    crown: float = 0.0

    def key(self) -> str:
        """Name of the stored solution; a flat layer's says nothing of a crown."""
        return entry_key(
            {
                "layer": round(self.layer, 9),
                "mesh": round(self.mesh_size, 9),
                "depths": self.depths,
                "poisson": self.poisson_ratio,
                "tip": self.tip.rows,
                "wall": round(self.wall_radius, 9),
                "recipe": RECIPE,
                "mujoco": _mujoco_version(),
                **({"crown": round(self.crown, 9)} if self.crown else {}),
            }
        )


def _solve(inputs: PressInputs, on_step: Callable[[float], None] | None) -> UnitPress:
    """Run MuJoCo; imported here so that stored solutions need no solver."""
    from sims.contact.library.unit_press import solve_unit_press

    return solve_unit_press(
        round(inputs.layer, 9),
        round(inputs.mesh_size, 9),
        inputs.depths,
        inputs.poisson_ratio,
        on_step,
        inputs.tip,
        round(inputs.wall_radius, 9),
        round(inputs.crown, 9),
    )


def stored_press(
    inputs: PressInputs, on_step: Callable[[float], None] | None = None
) -> tuple[UnitPress, tuple[str, ...]]:
    """The solved states, with notes on what the user should know.

    Parameters
    ----------
    inputs : what is pressed, and how
    on_step : called with the fraction done while solving

    Raises
    ------
    ContactSolveError : a state fails its checks
    """
    key = inputs.key()
    notes: tuple[str, ...] = ()
    if key not in _SOLVED:
        press = read_entry(key)
        if press is None:
            press = _solve(inputs, on_step)
            note = write_entry(key, press)
            notes = (note,) if note else ()
        _SOLVED[key] = press
    return _SOLVED[key], notes
