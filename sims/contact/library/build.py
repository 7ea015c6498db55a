"""Make the library of solved presses anew: two solves a layer, pad and crown, in parallel, resumable.

Every finished solve is stored in the cache of solved presses at once, so an interrupted build goes on
where it stopped. Workers are processes of their own, one thread each; a solve is a pure function of its
inputs, so their number does not change the result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib.metadata import version
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np

from design.arrays import FloatArray
from design.errors import OutputError
from design.whole_file import folder_fault, made_folder, require_file_name, whole_file
from sims.contact.library.incompressible import POISSON_RATIOS, nearly_incompressible
from sims.contact.library.press_fit import fit_press
from sims.contact.library.profile_library import (
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
from sims.contact.library.profiles import UnitPress
from sims.contact.library.smooth_press import SmoothPress
from sims.contact.library.stored_press import RECIPE, PressInputs, stored_press
from sims.contact.scope import DEPTH_STEP, FIRST_DEPTHS, WALL_RADIUS

Pad = tuple[float, float]
"""Layer and radius of the wall [tip radii]."""

LIBRARY_MESH = 1 / 15
"""Node spacing under the tip of the library's entries [tip radii]: 0.2 mm for a 3 mm tip."""


def library_depths(layer: float) -> tuple[float, ...]:
    """Depths solved for an entry [tip radii]: the same shares of the deepest press in every entry."""
    deepest = deepest_press(layer)
    longest = deepest_press(max(LAYERS))
    steady = np.arange(FIRST_DEPTHS[-1] + DEPTH_STEP, longest - 0.5 * DEPTH_STEP, DEPTH_STEP)
    schedule = np.concatenate([FIRST_DEPTHS, steady, [longest]])
    return tuple(round(float(depth), 9) for depth in schedule * (deepest / longest))


def entry_inputs(
    layer: float, poisson_ratio: float, wall_radius: float = WALL_RADIUS, crown: float = 0.0
) -> PressInputs:
    """What an entry's solve depends on."""
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
    """The solved states of one layer and pad [tip radii], from the cache or solved and stored there."""
    return stored_press(entry_inputs(layer, poisson_ratio, wall_radius, crown))[0]


def entry_press(layer: float, wall_radius: float = WALL_RADIUS, crown: float = 0.0) -> SmoothPress:
    """One nearly incompressible entry, from both of its solves."""
    soft, stiff = (fit_press(solve_entry(layer, ratio, wall_radius, crown)) for ratio in POISSON_RATIOS)
    return nearly_incompressible(soft, stiff)


def slope_and_bow(flat: SmoothPress, crowned: Sequence[SmoothPress]) -> tuple[FloatArray, FloatArray]:
    """(coefficient, VALUES) factors of the crown and of its square in what two crowns change of a flat pad."""
    powers = np.array([[press.crown, press.crown**2] for press in crowned])
    changes = np.array([press.coefficients - flat.coefficients for press in crowned])
    slope, bow = np.tensordot(np.linalg.inv(powers), changes, axes=1)
    return slope, bow


def crown_changes(
    flat: Mapping[Pad, SmoothPress], crowned: Mapping[Pad, Sequence[SmoothPress]], centre: Pad = CROWN_CENTRE
) -> CrownChanges:
    """What crowns change, in the solved pads and, by sums, in the others.

    Parameters
    ----------
    flat : layer and radius of the wall [tip radii] -> its press
    crowned : the centre -> its presses at two crowns; other layers in its wall, its layer in other walls -> one
    centre : layer and radius of the wall [tip radii]
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
    """The library of its solved presses.

    Parameters
    ----------
    presses : the entries, thinnest first
    pads : the `WALL_LAYERS` in every other pad, smallest first
    crowned : what crowns change of them
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
    """Layers and radii of the wall of the pads that are solved under crowns [tip radii]."""
    layer, radius = CROWN_CENTRE
    pads = [(other, radius) for other in CROWN_LAYERS] + [(layer, other) for other in CROWN_RADII]
    return list(dict.fromkeys(pads))


def all_pads() -> list[tuple[float, float, float]]:
    """Layer, radius of the wall and crown of every press that is solved, the costliest first."""
    pads = [(layer, WALL_RADIUS, 0.0) for layer in LAYERS]
    pads += [(layer, radius, 0.0) for layer in WALL_LAYERS for radius in PAD_RADII]
    pads += [(*pad, crown) for pad in crowned_pads() for crown in solved_crowns(*pad)]
    return sorted(pads, reverse=True)


def build_library(workers: int, on_step: Callable[[int, int], None] | None = None) -> Library:
    """Solve every press that the cache lacks, and fit them all.

    Parameters
    ----------
    workers : processes at work
    on_step : called with the number of solves done and of all

    Raises
    ------
    ContactSolveError : a layer's state fails its checks
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
    """Refuse a file before hours are spent on its content.

    Raises
    ------
    OutputError : the file cannot be written
    """
    require_file_name(path)
    fault = folder_fault(path.parent)
    if fault or path.is_dir():
        raise OutputError(f"{path}: cannot be written ({fault or 'a folder'}); choose another --out")


def write_library(library: Library, path: Path) -> None:
    """Write the file in one step.

    Raises
    ------
    OutputError : the file cannot be written
    """
    made_folder(path.parent, "choose another --out")
    with whole_file(path, "choose another --out") as hidden, hidden.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **pack(library))
