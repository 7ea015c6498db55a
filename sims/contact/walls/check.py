"""How far the wall correction is from three-dimensional runs that are not in its data.

    python -m sims.contact.walls.check FOLDER
prints, per pad and press depth, the error of force and height without and with the correction, in percent and, for
a 3 mm tip, in micrometres. "Height" is compared at all free nodes of the top at least 0.1 tip radii (0.3 mm) outside
the contact edge, "distance" is height times the cosine of the surface's slope.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sims.contact.walls.fit import CLEAR_OF_CONTACT, contact_radii, difference, rim_heights
from sims.contact.walls.near_walls import wall_correction
from sims.contact.walls.runs import CHECK_WALLS, WallRun, check_run, make_runs, read_run
from sims.contact.walls.shape import RIM_RADII

FloatArray = NDArray[np.float64]

MICROMETRES = 3000.0
"""Micrometres in a tip radius of 3 mm."""


@dataclass(frozen=True, kw_only=True)
class WallError:
    """Errors at one depth, without and with the correction; heights in tip radii.

    Attributes
    ----------
    depth : press depth [tip radii]
    force_before, force_after : force over that of the three-dimensional run, less 1 [-]
    height_before, height_after : (rms, largest) error of the height
    distance_after : (rms, largest) error times the cosine of the surface's slope
    """

    depth: float
    force_before: float
    force_after: float
    height_before: tuple[float, float]
    height_after: tuple[float, float]
    distance_after: tuple[float, float]


def _size(values: FloatArray) -> tuple[float, float]:
    return float(np.sqrt(np.mean(values**2))), float(np.abs(values).max())


def check_runs(name: str) -> tuple[WallRun, WallRun]:
    """Reference and pad of one check."""
    walls = CHECK_WALLS[name]
    return check_run(walls, near=False), check_run(walls)


def wall_errors(reference_run: WallRun, pad_run: WallRun, folder: Path) -> Iterator[WallError]:
    """Errors at every depth of a pair of stored runs."""
    reference, pad = read_run(reference_run, folder), read_run(pad_run, folder)
    contact = contact_radii(reference)
    for index, depth in enumerate(pad.depths):
        rim = (RIM_RADII, rim_heights(reference, index))
        rim[1][-1] = 0.0
        found = wall_correction(pad_run.layer, float(depth), pad_run.walls, rim)
        places = difference(reference, pad, pad_run.walls, index)
        limits = pad_run.walls
        free = places.beyond(float(contact[index]) + CLEAR_OF_CONTACT)
        left = free.dz - found.height(
            np.clip(free.x, -limits[0], limits[1]), np.clip(free.y, -limits[2], limits[3])
        )
        ratio = float(pad.force[index] / reference.force[index])
        yield WallError(
            depth=float(depth),
            force_before=1.0 / ratio - 1.0,
            force_after=found.force_factor / ratio - 1.0,
            height_before=_size(free.dz),
            height_after=_size(left),
            distance_after=_size(left * free.cosine),
        )


def _row(error: WallError) -> str:
    sizes = [
        f"{MICROMETRES * one:4.0f}" for pair in (error.height_before, error.height_after) for one in pair
    ]
    distance = " / ".join(f"{MICROMETRES * one:4.0f}" for one in error.distance_after)
    return (
        f"| {3.0 * error.depth:.1f} | {100 * error.force_before:+.1f} | {100 * error.force_after:+.1f} | "
        f"{sizes[0]} / {sizes[1]} | {sizes[2]} / {sizes[3]} | {distance} |"
    )


def table(reference: WallRun, pad: WallRun, folder: Path) -> list[str]:
    """Rows of a table in Markdown."""
    head = "| depth mm | force % before | after | height um rms / max before | after | distance um after |"
    return [
        head,
        "|---|---|---|---|---|---|",
        *(_row(error) for error in wall_errors(reference, pad, folder)),
    ]


def variants(name: str) -> dict[str, tuple[WallRun, WallRun]]:
    """The check on another mesh, with another contact stiffness and another Poisson's ratio."""
    reference, pad = check_runs(name)
    changed: dict[str, Callable[[WallRun], WallRun]] = {
        "finer mesh, to 3 mm": lambda run: replace(run, spacing=0.3, depths=run.depths[:3]),
        "stiffer contact": lambda run: replace(run, stiffness=2.0),
        "Poisson's ratio 0.49": lambda run: replace(run, poisson_ratio=0.49),
    }
    return {label: (change(reference), change(pad)) for label, change in changed.items()}


if __name__ == "__main__":
    where = Path(sys.argv[1])
    for check in CHECK_WALLS:
        make_runs(check_runs(check), where)
        print(f"\n{check}: walls {CHECK_WALLS[check]}", *table(*check_runs(check), where), sep="\n")
    for label, pair in variants("near a wall").items():
        make_runs(pair, where)
        print(f"\nnear a wall, {label}", *table(*pair, where), sep="\n")
