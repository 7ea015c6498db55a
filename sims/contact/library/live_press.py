"""Solve a design's press live: both Poisson's ratios at once, one thread each."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from design.errors import InputError
from design.progress import OnShare
from design.spec import SensorDesign
from sims.contact.library.incompressible import POISSON_RATIOS, nearly_incompressible
from sims.contact.library.press_fit import fit_press
from sims.contact.library.profiles import UnitPress
from sims.contact.library.smooth_press import SmoothPress
from sims.contact.library.stored_press import PressInputs, stored_press
from sims.contact.scope import layer_depth, solved_depths, tip_radius_mm, wall_radius
from sims.contact.tip import tip_of

DEFAULT_MESH = 0.1
"""Node spacing under the tip [tip radii]: 0.3 mm for a 3 mm tip."""
MESH_RANGE = (0.04, 0.15)
"""Spacings that are accepted [tip radii]; coarser facets bridge the equator of the tip and lose the contact
edge, finer ones may chatter at deep presses (which is refused, not hidden)."""
LEAST_DEPTH = 0.4 / 3
"""A live solve goes at least so deep, so that a smooth description has enough depths [tip radii]."""


_SMOOTH: dict[tuple[int, int], tuple[UnitPress, UnitPress, SmoothPress]] = {}
"""Presses made of this process's solutions, by their identity (they are kept alive beside it)."""


def mesh_size(design: SensorDesign, mesh_mm: float | None) -> float:
    """Node spacing under the tip [tip radii]; None takes the default.

    Raises
    ------
    InputError : outside `MESH_RANGE`
    """
    if mesh_mm is None:
        return DEFAULT_MESH
    radius = tip_radius_mm(design)
    low, high = (bound * radius for bound in MESH_RANGE)
    if not low - 1e-9 <= mesh_mm <= high + 1e-9:
        raise InputError(f"mesh_mm: {mesh_mm:g} mm must lie between {low:g} and {high:g} mm for this tip")
    return mesh_mm / radius


def live_press(
    design: SensorDesign, spacing: float, deepest: float, on_step: OnShare | None
) -> tuple[UnitPress, SmoothPress, tuple[str, ...]]:
    """The press of a design's tip, from the cache or solved now.

    Parameters
    ----------
    design : the sensor
    spacing, deepest : node spacing under the tip, deepest press [tip radii]
    on_step : called with the fraction done

    Returns
    -------
    The solved states at the larger Poisson's ratio, the nearly incompressible press, and notes.

    Raises
    ------
    ContactSolveError : a state fails its checks
    """
    layer, tip = layer_depth(design), tip_of(design.indenter)
    depths = tuple(round(float(depth), 9) for depth in solved_depths(layer, max(deepest, LEAST_DEPTH)))
    inputs = PressInputs(
        layer=layer,
        mesh_size=spacing,
        depths=depths,
        poisson_ratio=POISSON_RATIOS[-1],
        tip=tip,
        wall_radius=wall_radius(design),
    )
    return both_ratios(inputs, on_step)


def both_ratios(
    inputs: PressInputs, on_step: OnShare | None
) -> tuple[UnitPress, SmoothPress, tuple[str, ...]]:
    """The press at both `POISSON_RATIOS`, whatever that of the inputs is; returns and errors of `live_press`.

    Parameters
    ----------
    inputs : what is pressed, and how
    on_step : called with the fraction done
    """
    tell = _Progress(on_step)

    def solve(ratio: float) -> tuple[UnitPress, tuple[str, ...]]:
        own = replace(inputs, poisson_ratio=ratio)
        return stored_press(own, lambda share: tell.advance(ratio, share))

    with ThreadPoolExecutor(max_workers=len(POISSON_RATIOS)) as pool:
        (soft, _), (stiff, notes) = pool.map(solve, POISSON_RATIOS)
    return stiff, _smooth(soft, stiff), notes


def live_note(design: SensorDesign, mesh_mm: float | None) -> str:
    """Why and how a press was solved live, and that its error is not known as the library's is."""
    tip = tip_radius_mm(design)
    spacing = DEFAULT_MESH * tip if mesh_mm is None else mesh_mm
    return (
        f"contact solved live on a mesh of {spacing:g} mm under the tip, not taken from the library: it is "
        "compared with nothing"
    )


class _Progress:
    """The mean progress of both solves."""

    def __init__(self, on_step: OnShare | None) -> None:
        self.on_step, self.shares = on_step, dict.fromkeys(POISSON_RATIOS, 0.0)

    def advance(self, ratio: float, share: float) -> None:
        self.shares[ratio] = share
        if self.on_step is not None:
            self.on_step(sum(self.shares.values()) / len(self.shares))


def _smooth(soft: UnitPress, stiff: UnitPress) -> SmoothPress:
    """The nearly incompressible press, made once for every pair of solutions of this process."""
    key = (id(soft), id(stiff))
    if key not in _SMOOTH:
        _SMOOTH[key] = (soft, stiff, nearly_incompressible(fit_press(soft), fit_press(stiff)))
    return _SMOOTH[key][2]
