"""Compute the shipped library of solved presses again.

    python -m tests.validation.contact.library_build

solves every press of the library, fits it, writes `build/validation/profiles.npz` and prints the difference from the
shipped file `sims/contact/library/data/profiles.npz`, which the new one can replace: two hours or more on two cores.
It takes two solves, at two Poisson's ratios, for every combination of layer thickness, wall radius and crown. Every
finished solve is cached at once, so an interrupted run continues where it stopped. Workers are separate processes with
one thread each. A solve depends on its inputs only, so the number of workers does not change the result.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import astuple
from importlib.metadata import version
from multiprocessing import active_children, get_context

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.rules.shape import LARGEST_CROWN, LARGEST_REACH, LEAST_RIM_SHARE
from optopad.sims.contact.library.live_press import fit_press
from optopad.sims.contact.library.profile_library import (
    CROWN_CENTRE,
    CROWN_LAYERS,
    CROWN_RADII,
    FILE,
    FORMAT,
    LAYERS,
    PAD_RADII,
    WALL_LAYERS,
    CrownChanges,
    Library,
    deepest_press,
    shipped_library,
)
from optopad.sims.contact.library.smooth_press import POISSON_RATIOS, SmoothPress, nearly_incompressible
from optopad.sims.contact.library.stored_press import RECIPE, PressInputs, UnitPress, stored_press
from optopad.sims.contact.scope import DEPTH_STEP, FIRST_DEPTHS, WALL_RADIUS
from tests.validation.contact.contact_reference import BUILD

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


def largest_crown(layer: float, wall_radius: float) -> float:
    """The largest crown (tip radius over crown radius) that the library covers [-], in steps of 0.0001.

    Parameters
    ----------
    layer, wall_radius : layer thickness at the apex, and wall radius [tip radii]
    """
    fall = min((1.0 - LEAST_RIM_SHARE) * layer, wall_radius)
    at_the_rim = 2.0 * fall / (fall**2 + wall_radius**2)
    return math.floor(1e4 * min(at_the_rim, LARGEST_REACH / wall_radius, LARGEST_CROWN)) / 1e4


def solved_crowns(layer: float, wall_radius: float) -> tuple[float, ...]:
    """The crowns that are solved for a pad, increasing: the largest one; for `CROWN_CENTRE`, also half of it.

    A crown is given as tip radius over the crown's radius [-].

    Parameters
    ----------
    layer, wall_radius : layer thickness at the apex, and wall radius [tip radii]
    """
    largest = largest_crown(layer, wall_radius)
    return (round(0.5 * largest, 9), largest) if (layer, wall_radius) == CROWN_CENTRE else (largest,)


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
        residual=np.array([astuple(press.residual) for press in presses]),
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


def build_library(workers: int) -> Library:
    """Build the library: solve every press that is not cached, and fit all presses.

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
                print(f"solved {count} of {len(jobs)}", flush=True)
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


def pack(library: Library) -> dict[str, NDArray[np.generic]]:
    """Arrays of the library file. Coefficients are in single precision, which rounds by 2 nm for a 3 mm tip."""
    return {
        "format": np.array(FORMAT),
        "recipe": np.array(library.recipe),
        "layers": library.layers,
        "first": library.first,
        "wall_radius": np.array(library.wall_radius),
        "mesh_size": np.array(library.mesh_size),
        "knots": library.knots,
        "coefficients": library.coefficients.astype(np.float32),
        "wall_layers": library.wall_layers,
        "pad_radii": library.pad_radii,
        "wall_changes": library.wall_changes.astype(np.float32),
        "crown_layers": library.crowned.layers,
        "crown_radii": library.crowned.radii,
        "crown_slopes": library.crowned.slopes.astype(np.float32),
        "crown_bow": library.crowned.bow.astype(np.float32),
        "residual": library.residual,
        "versions": np.array(library.versions),
    }


def library_differences(left: Library, right: Library) -> tuple[float, float]:
    """Difference between two libraries that have the same layers and wall radii.

    Returns
    -------
    force : largest difference of a force, over the force in `right` [-]
    surface : largest difference of a coordinate of the free surface [tip radii]
    """
    force = surface = 0.0
    pads = [(layer, right.wall_radius, 0.0) for layer in right.layers]
    pads += [(layer, radius, 0.0) for layer in right.wall_layers for radius in right.pad_radii]
    pads += [
        (layer, radius, crown)
        for layer in right.crowned.layers
        for radius in right.crowned.radii
        for crown in (0.5 * largest_crown(layer, radius), largest_crown(layer, radius))
    ]
    for pad in pads:
        first, second = (library.press(*map(float, pad)) for library in (left, right))
        for depth in np.linspace(0.02, 1.0, 25) * second.deepest:
            here, there = first.values_at(float(depth)), second.values_at(float(depth))
            force = max(force, abs(float(np.expm1(here.log_force - there.log_force))))
            surface = max(surface, float(np.abs(here.free - there.free).max()))
    return force, surface


def main() -> None:
    """Build the library and compare it with the shipped one."""
    library = build_library(os.cpu_count() or 1)
    path = BUILD / FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, allow_pickle=False, **pack(library))
    force, surface = library_differences(library, shipped_library())
    print(path)
    print(f"force within {100 * force:.2g} %, surface within {surface:.2g} tip radii of the shipped library")


if __name__ == "__main__":
    main()
