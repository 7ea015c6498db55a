"""Compute the library of solved presses, fit splines to presses over depth, and solve a design's press live.

Building the library takes two solves, at two Poisson's ratios, for every combination of layer thickness, wall radius
and crown. Every finished solve is cached at once, so an interrupted run continues where it stopped. Workers are
separate processes with one thread each. A solve depends on its inputs only, so the number of workers does not change
the result.

`fit_press` reduces a solved press to smooth functions of depth (`SmoothPress`). They are splines, fitted by least
squares, with one interval for every `DEPTHS_PER_INTERVAL` solved depths. The fit has to smooth, because light is
differentiated with respect to depth, while the facets of a mesh come into contact one after another. So the contact
edge and the force jitter as the contact grows, by up to 10 µm and 0.4 % at a spacing of a fifteenth of the tip radius
(3 mm tip, near 1 mm depth). `FitResidual` records the distance of the solved states from the fit.

`live_press` solves a design's press at both Poisson's ratios in parallel, one thread each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from dataclasses import replace
from importlib.metadata import version
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator, make_lsq_spline

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, OutputError
from optopad.design.files import folder_fault, made_folder, require_file_name, whole_file
from optopad.design.progress import OnShare
from optopad.design.spec import SensorDesign
from optopad.sims.contact.library.profile_library import (
    CROWN_CENTRE,
    CROWN_LAYERS,
    CROWN_RADII,
    LAYERS,
    PAD_RADII,
    WALL_LAYERS,
    CrownChanges,
    Library,
    deepest_press,
    pack,
    solved_crowns,
)
from optopad.sims.contact.library.profiles import UnitPress
from optopad.sims.contact.library.smooth_press import (
    LOAD_SHARES,
    POISSON_RATIOS,
    FitResidual,
    SmoothPress,
    StateValues,
    contact_tolerance,
    free_surface,
    nearly_incompressible,
    off_crown,
    sample_arcs,
)
from optopad.sims.contact.library.stored_press import RECIPE, PressInputs, stored_press
from optopad.sims.contact.scope import (
    DEPTH_STEP,
    FIRST_DEPTHS,
    WALL_RADIUS,
    layer_depth,
    solved_depths,
    tip_radius_mm,
    wall_radius,
)
from optopad.sims.contact.tip import tip_coordinate, tip_of, tip_outline

DEPTHS_PER_INTERVAL = 3
"""Number of solved depths per interval of the splines."""


def _resampled(points: FloatArray, wall_radius: float) -> FloatArray:
    """Resample a curve (n, 2) of radius and height at the arc lengths of `sample_arcs`; the result is (sample, 2)."""
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    return np.asarray(
        CubicSpline(length, points)(sample_arcs(float(length[-1]), wall_radius)), dtype=np.float64
    )


def tributary_areas(radius: FloatArray, height: FloatArray) -> FloatArray:
    """Area (node,) whose load each node of a surface of revolution takes: ∫ N 2πr ds with the node's hat function N.

    The surface is given by the radii and heights (node,) of its nodes. A node on the axis gets a third of the disc that
    reaches to its neighbour, instead of the quarter that reaches half-way.
    """
    length = np.hypot(np.diff(radius), np.diff(height))
    areas = np.zeros_like(radius)
    areas[:-1] += 2.0 * np.pi * length * (radius[:-1] / 3.0 + radius[1:] / 6.0)
    areas[1:] += 2.0 * np.pi * length * (radius[:-1] / 6.0 + radius[1:] / 3.0)
    return areas


def _load_inside(
    force: FloatArray, radius: FloatArray, height: FloatArray, along: FloatArray, edge: float
) -> FloatArray:
    """Share (share,) of the load inside each of the fractions `LOAD_SHARES` of the contact's arc length.

    Parameters
    ----------
    force, radius, height : (node,) force on each top node, and its position
    along : (node,) arc length along the tip's outline from its apex to each node
    edge : the same arc length to the contact edge
    """
    count = int(np.flatnonzero(force > 0.0)[-1]) + 1
    inside = np.cumsum(force[:count]) / force[:count].sum()
    reach = np.cumsum(tributary_areas(radius, height))[: count - 1]
    ring = np.pi * (radius[1:] + radius[:-1]) * np.hypot(np.diff(radius), np.diff(height))
    root = np.sqrt(
        np.append(0.0, np.cumsum(ring))
    )  # square root of the area up to a node: nearly linear along the tip
    whole = float(np.interp(edge, along, root)) ** 2
    kept = reach < whole
    places = np.concatenate([[0.0], reach[kept] / whole, [1.0]])
    shares = np.concatenate([[0.0], inside[: count - 1][kept], [1.0]])
    wanted = np.interp(LOAD_SHARES * edge, along, root) ** 2 / whole
    return np.asarray(PchipInterpolator(places, shares)(np.minimum(wanted, 1.0)), dtype=np.float64)


def _state(unit: UnitPress, index: int) -> StateValues:
    """The numbers that describe the solved press at one of its depths, to be fitted by splines."""
    depth = float(unit.depths[index])
    radius, height = unit.radii[index], unit.heights[index]
    tolerance = contact_tolerance(unit.mesh_size, unit.wedge_angle)
    edge, free = free_surface(
        radius, height, depth, spacing=unit.mesh_size, tolerance=tolerance, tip=unit.tip, crown=unit.crown
    )
    start = np.stack(tip_outline(np.array(edge), depth, unit.tip))
    dense = off_crown(np.concatenate([start[None], free]), unit.wall_radius, unit.crown)
    return StateValues(
        log_force=float(np.log(unit.force[index])),
        log_edge=float(np.log(edge)),
        free=_resampled(dense, unit.wall_radius) - dense[0],
        load=_load_inside(
            unit.normal_force[index], radius, height, tip_coordinate(radius, height, depth, unit.tip), edge
        ),
    )


def _residual(states: FloatArray, fitted: FloatArray) -> FitResidual:
    """Distances between solved states and their spline fit; both arrays are (depth, VALUES)."""
    force = np.expm1(fitted[:, 0] - states[:, 0])
    edge = np.exp(fitted[:, 1]) - np.exp(states[:, 1])
    pairs = zip(map(StateValues.unpacked, states), map(StateValues.unpacked, fitted), strict=True)
    surface = np.array([np.hypot(*(after.free - before.free).T) for before, after in pairs])
    figures = [np.array([np.sqrt(np.mean(x**2)), np.abs(x).max()]) for x in (force, edge, surface)]
    return FitResidual.from_array(np.concatenate(figures))


def interval_knots(places: FloatArray) -> FloatArray:
    """Knots of cubic splines for increasing sample positions; the first and last knot occur four times each."""
    inner = places[DEPTHS_PER_INTERVAL:-DEPTHS_PER_INTERVAL:DEPTHS_PER_INTERVAL]
    return np.concatenate([np.repeat(places[0], 4), inner, np.repeat(places[-1], 4)])


def fit_press(unit: UnitPress) -> SmoothPress:
    """Fit splines over ln(depth / deepest depth) to the solved states of a press.

    Parameters
    ----------
    unit : the solved states, at four depths or more
    """
    states = np.array([_state(unit, index).packed() for index in range(unit.depths.size)])
    places = np.log(unit.depths / unit.deepest)
    spline = make_lsq_spline(places, states, interval_knots(places), k=3)
    return SmoothPress(
        layer_depth=unit.layer_depth,
        wall_radius=unit.wall_radius,
        crown=unit.crown,
        mesh_size=unit.mesh_size,
        first=float(unit.depths[0]),
        deepest=unit.deepest,
        knots=spline.t,
        coefficients=spline.c,
        residual=_residual(states, spline(places)),
        versions=unit.versions,
        tip=unit.tip,
    )


DEFAULT_MESH = 0.1
"""Node spacing under the tip [tip radii]: 0.3 mm for a 3 mm tip."""
MESH_RANGE = (0.04, 0.15)
"""Accepted node spacings under the tip [tip radii]. Coarser facets cannot follow the tip and lose the contact edge;
finer ones may chatter in deep presses, which raises an error.
"""
LEAST_DEPTH = 0.4 / 3
"""Depth that every live solve reaches at least [tip radii], so that the spline fit has enough depths."""


_SMOOTH: dict[tuple[int, int], tuple[UnitPress, UnitPress, SmoothPress]] = {}
"""Fitted presses of this process, by the `id` of their two solutions, which are stored too so that ids stay valid."""


def mesh_size(design: SensorDesign, mesh_mm: float | None) -> float:
    """Convert a node spacing under the tip from mm to tip radii; None becomes `DEFAULT_MESH`.

    Raises
    ------
    InputError : the spacing is outside `MESH_RANGE`
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
    """The press of a design's tip, solved now or taken from the cache of earlier solves.

    Parameters
    ----------
    design : the sensor
    spacing, deepest : node spacing under the tip, and deepest press [tip radii]
    on_step : called with the fraction done (0 to 1)

    Returns
    -------
    The solved states at the larger Poisson's ratio, the nearly incompressible press extrapolated from both ratios, and
    notes for the user.

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
    """Solve a press at both `POISSON_RATIOS`, and extrapolate; return values and errors are those of `live_press`.

    Parameters
    ----------
    inputs : all inputs of the solution; its `poisson_ratio` is ignored
    on_step : called with the fraction done (0 to 1)
    """
    tell = _Progress(on_step)

    def solve(ratio: float) -> tuple[UnitPress, tuple[str, ...]]:
        own = replace(inputs, poisson_ratio=ratio)
        return stored_press(own, lambda share: tell.advance(ratio, share))

    with ThreadPoolExecutor(max_workers=len(POISSON_RATIOS)) as pool:
        (soft, _), (stiff, notes) = pool.map(solve, POISSON_RATIOS)
    return stiff, _smooth(soft, stiff), notes


def live_note(design: SensorDesign, mesh_mm: float | None) -> str:
    """A note for the user that a press was solved live, with which mesh, and without a comparison to a reference."""
    tip = tip_radius_mm(design)
    spacing = DEFAULT_MESH * tip if mesh_mm is None else mesh_mm
    return (
        f"contact solved live on a mesh of {spacing:g} mm under the tip, not taken from the library: it "
        "was not compared with a reference"
    )


class _Progress:
    """Reports the mean progress of two solves that run in parallel threads."""

    def __init__(self, on_step: OnShare | None) -> None:
        self.on_step, self.shares = on_step, dict.fromkeys(POISSON_RATIOS, 0.0)

    def advance(self, ratio: float, share: float) -> None:
        self.shares[ratio] = share
        if self.on_step is not None:
            self.on_step(sum(self.shares.values()) / len(self.shares))


def _smooth(soft: UnitPress, stiff: UnitPress) -> SmoothPress:
    """The nearly incompressible press extrapolated from two solutions; this process caches it for this pair."""
    key = (id(soft), id(stiff))
    if key not in _SMOOTH:
        _SMOOTH[key] = (soft, stiff, nearly_incompressible(fit_press(soft), fit_press(stiff)))
    return _SMOOTH[key][2]


Pad = tuple[float, float]
"""Layer thickness and wall radius of a round pad [tip radii]."""

LIBRARY_MESH = 1 / 15
"""Node spacing under the tip for the library's presses [tip radii]: 0.2 mm for a 3 mm tip."""


def library_depths(layer: float) -> tuple[float, ...]:
    """Depths solved for a layer thickness [tip radii]: the same fractions of the deepest press for every thickness."""
    deepest = deepest_press(layer)
    longest = deepest_press(max(LAYERS))
    steady = np.arange(FIRST_DEPTHS[-1] + DEPTH_STEP, longest - 0.5 * DEPTH_STEP, DEPTH_STEP)
    schedule = np.concatenate([FIRST_DEPTHS, steady, [longest]])
    return tuple(round(float(depth), 9) for depth in schedule * (deepest / longest))


def entry_inputs(
    layer: float, poisson_ratio: float, wall_radius: float = WALL_RADIUS, crown: float = 0.0
) -> PressInputs:
    """Inputs of one solve for the shipped library; layer thickness and wall radius in tip radii."""
    return PressInputs(
        layer=layer,
        mesh_size=LIBRARY_MESH,
        depths=library_depths(layer),
        poisson_ratio=poisson_ratio,
        wall_radius=wall_radius,
        crown=crown,
    )


def solve_entry(
    layer: float, poisson_ratio: float, wall_radius: float = WALL_RADIUS, crown: float = 0.0
) -> UnitPress:
    """Solved states for the shipped library, from the cache, or solved now and cached; lengths in tip radii."""
    return stored_press(entry_inputs(layer, poisson_ratio, wall_radius, crown))[0]


def entry_press(layer: float, wall_radius: float = WALL_RADIUS, crown: float = 0.0) -> SmoothPress:
    """One nearly incompressible press of the shipped library, from solves at both Poisson's ratios."""
    soft, stiff = (fit_press(solve_entry(layer, ratio, wall_radius, crown)) for ratio in POISSON_RATIOS)
    return nearly_incompressible(soft, stiff)


def slope_and_bow(flat: SmoothPress, crowned: Sequence[SmoothPress]) -> tuple[FloatArray, FloatArray]:
    """Factors a and b (coefficient, VALUES): a crown changes the spline coefficients by a·crown + b·crown².

    They follow exactly from three presses of one pad: flat, and under two crowns.
    """
    powers = np.array([[press.crown, press.crown**2] for press in crowned])
    changes = np.array([press.coefficients - flat.coefficients for press in crowned])
    slope, bow = np.tensordot(np.linalg.inv(powers), changes, axes=1)
    return slope, bow


def crown_changes(
    flat: Mapping[Pad, SmoothPress], crowned: Mapping[Pad, Sequence[SmoothPress]], centre: Pad = CROWN_CENTRE
) -> CrownChanges:
    """How crowns change a flat pad's spline coefficients, for every combination of layer thickness and wall radius.

    Only some combinations are solved. For the others, the changes of the linear factor by layer and by wall are added.

    Parameters
    ----------
    flat : presses into flat pads, by (layer thickness, wall radius) [tip radii]
    crowned : presses into crowned pads with the same keys, largest crown last. The pad `centre` has two crowns. The
        others share its layer thickness or its wall radius, and have one crown
    centre : layer thickness and wall radius of the pad with which the others are compared [tip radii]
    """
    _, bow = slope_and_bow(flat[centre], crowned[centre])
    largest = {pad: presses[-1] for pad, presses in crowned.items()}
    slopes = {
        pad: (press.coefficients - flat[pad].coefficients) / press.crown - press.crown * bow
        for pad, press in largest.items()
    }
    layers, radii = (sorted(set(places)) for places in zip(*slopes, strict=True))
    return CrownChanges(
        layers=np.array(layers),
        radii=np.array(radii),
        slopes=np.array(
            [
                [slopes[layer, centre[1]] + slopes[centre[0], radius] - slopes[centre] for radius in radii]
                for layer in layers
            ]
        ),
        bow=bow,
    )


def assembled(
    presses: Sequence[SmoothPress],
    pads: Sequence[Sequence[SmoothPress]],
    crowned: CrownChanges,
) -> Library:
    """Assemble a `Library` from solved presses.

    Parameters
    ----------
    presses : presses into pads of the default wall radius, thinnest layer first
    pads : for each layer thickness in `WALL_LAYERS`, its presses at the other wall radii, smallest first
    crowned : how crowns change the flat pads' coefficients
    """
    entries = {press.layer_depth: press.coefficients for press in presses}
    return Library(
        layers=np.array([press.layer_depth for press in presses]),
        first=np.array([press.first for press in presses]),
        wall_radius=presses[0].wall_radius,
        mesh_size=presses[0].mesh_size,
        knots=presses[0].knots,
        coefficients=np.array([press.coefficients for press in presses]),
        wall_layers=np.array([of_layer[0].layer_depth for of_layer in pads]),
        pad_radii=np.array([pad.wall_radius for pad in pads[0]]),
        wall_changes=np.array(
            [[pad.coefficients - entries[pad.layer_depth] for pad in of_layer] for of_layer in pads]
        ),
        crowned=crowned,
        residual=np.array([press.residual.as_array() for press in presses]),
        recipe=RECIPE,
        versions=(*presses[0].versions, f"numpy {version('numpy')}", f"scipy {version('scipy')}"),
    )


def crowned_pads() -> list[Pad]:
    """Layer thicknesses and wall radii of the pads that are solved with crowns [tip radii]."""
    layer, radius = CROWN_CENTRE
    pads = [(other, radius) for other in CROWN_LAYERS] + [(layer, other) for other in CROWN_RADII]
    return list(dict.fromkeys(pads))


def all_pads() -> list[tuple[float, float, float]]:
    """Layer thickness, wall radius [tip radii] and crown [-] of every press to solve, the costliest first."""
    pads = [(layer, WALL_RADIUS, 0.0) for layer in LAYERS]
    pads += [(layer, radius, 0.0) for layer in WALL_LAYERS for radius in PAD_RADII]
    pads += [(*pad, crown) for pad in crowned_pads() for crown in solved_crowns(*pad)]
    return sorted(pads, reverse=True)


def build_library(workers: int, on_step: Callable[[int, int], None] | None = None) -> Library:
    """Build the library: solve every press that is not cached, and fit all presses.

    Parameters
    ----------
    workers : number of worker processes
    on_step : called with the number of finished solves and the total number

    Raises
    ------
    ContactSolveError : a solved state fails its checks
    """
    solves = [
        (layer, ratio, radius, crown) for layer, radius, crown in all_pads() for ratio in POISSON_RATIOS
    ]
    with ProcessPoolExecutor(max_workers=workers, mp_context=get_context("spawn")) as pool:
        jobs = [pool.submit(solve_entry, *solve) for solve in solves]
        try:
            for count, job in enumerate(as_completed(jobs), start=1):
                job.result()
                if on_step is not None:
                    on_step(count, len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children():
                worker.terminate()
            raise
    entries = [entry_press(layer) for layer in LAYERS]
    pads = [[entry_press(layer, radius) for radius in PAD_RADII] for layer in WALL_LAYERS]
    flat = {(press.layer_depth, press.wall_radius): press for row in (entries, *pads) for press in row}
    crowned = {pad: [entry_press(*pad, crown) for crown in solved_crowns(*pad)] for pad in crowned_pads()}
    return assembled(entries, pads, crown_changes(flat, crowned))


def require_writable(path: Path) -> None:
    """Check that a file can be written, before hours are spent computing its content.

    Raises
    ------
    OutputError : the file cannot be written
    """
    require_file_name(path)
    fault = folder_fault(path.parent)
    if fault or path.is_dir():
        raise OutputError(f"{path}: cannot be written ({fault or 'a folder'}); choose another --out")


def write_library(library: Library, path: Path) -> None:
    """Write the library to a file, completely or not at all.

    Raises
    ------
    OutputError : the file cannot be written
    """
    made_folder(path.parent, "choose another --out")
    with whole_file(path, "choose another --out") as hidden, hidden.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **pack(library))
