"""Error of the contact library between its entries, and the command that measures it.

    python -m tests.validation.contact.library_interpolation

solves layers halfway between entries on the library's own mesh, compares them with what the library interpolates,
and writes docs/validation/contact-interpolation.md. Finished solves are kept in `build/validation/`, so that an
interrupted run continues. Lengths are in tip radii R.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import cKDTree

from sims.contact.library.build import entry_inputs, entry_press
from sims.contact.library.incompressible import POISSON_RATIOS
from sims.contact.library.profile_library import LAYERS, shipped_library
from sims.contact.library.smooth_press import SmoothPress
from sims.contact.library.store import CACHE_VARIABLE
from sims.contact.library.stored_press import stored_press
from tests.validation.contact.contact_reference import BUILD

PAGE = BUILD.parents[1] / "docs" / "validation" / "contact-interpolation.md"
BETWEEN = tuple(2.0 / (1.0 / LAYERS[k] + 1.0 / LAYERS[k + 1]) for k in (1, 4, 6, 10))
"""Layers halfway between entries in 1/layer, where the interpolation is weakest: thin, corner, usual, thick."""
DEPTH_SHARES = (0.04, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
TIP_UM = 3000.0
"""A tip of 3 mm: micrometres a tip radius."""


def distances_um(press: SmoothPress, other: SmoothPress, depth: float) -> np.ndarray:
    """(n,) distance of the points of one curve from another, for a tip of 3 mm."""
    curve, dense = press.curve_at(depth), other.curve_at(depth)
    knots = np.stack([dense.radius, dense.height], axis=1)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(knots, axis=0).T)))
    tangents = np.stack([np.cos(dense.inclination), np.sin(dense.inclination)], axis=1)
    line = CubicHermiteSpline(along, knots, tangents)
    points = line(np.linspace(0.0, along[-1], 100_000))
    return np.asarray(cKDTree(points).query(np.stack([curve.radius, curve.height], axis=1))[0] * TIP_UM)


def rows(layer: float) -> list[tuple[float, ...]]:
    """For every depth of a layer: layer and depth [R], errors of force [%], surface (rms, largest) and edge [um]."""
    solved, found = entry_press(layer), shipped_library().press(layer)
    lines = []
    for share in DEPTH_SHARES:
        depth = share * found.deepest
        apart = distances_um(found, solved, depth)
        force = 100.0 * (found.force_at(depth) / solved.force_at(depth) - 1.0)
        edge = (found.edge_at(depth) - solved.edge_at(depth)) * TIP_UM
        rms = float(np.sqrt(np.mean(apart**2)))
        lines.append((layer, depth, force, rms, float(apart.max()), edge))
    return lines


def page(lines: Sequence[tuple[float, ...]]) -> str:
    """The whole page."""
    force, rms, largest, edge = np.abs(np.array(lines)[:, 2:]).max(axis=0)
    return PAGE_TEXT.format(
        force=force,
        rms=rms,
        largest=largest,
        edge=edge,
        rows="\n".join(
            f"| {layer:.3f} | {depth:.3f} | {off:+.2f} | {rms:.2f} | {most:.2f} | {edge:+.1f} |"
            for layer, depth, off, rms, most, edge in lines
        ),
    )


PAGE_TEXT = """\
# Interpolation in the contact library

**Question.** The shipped contact library holds solved presses of twelve layers. How far off is a press of a layer
between two of them?

**Answer.** Force by {force:.2f} % at most, the surface by {rms:.1f} µm rms and {largest:.0f} µm at the worst point,
the contact's edge by up to {edge:.0f} µm, for a tip of 3 mm. Of force and surface that is no more than the error of the
solver itself ([contact.md](contact.md)).

## Method

- Four layers, from thin to thick, halfway between two entries in 1/layer, where interpolation is weakest. Seven depths
  of each.
- Each is solved on the library's own mesh and compared with what the library interpolates. So the figures hold the
  interpolation and the jitter of two solves, not the error of the solver.
- All of it is in a round pad with its wall at 16/3 tip radii.

## Figures

Layer and depth in tip radii R; micrometres for a tip of 3 mm.

| layer / R | depth / R | force % | surface rms um | surface largest um | contact edge um |
|---|---|---|---|---|---|
{rows}

## What it means

- A layer between two entries is about as good as an entry: no need to choose a thickness that the library holds.
- The contact's edge is the least sure, where it nears the shank of the tip, from about one tip radius of depth.
- What another wall changes is interpolated between four layers only and is not measured here;
  [the model's page](../understand/model.md) says what is known of it.

## Made by

`python -m tests.validation.contact.library_interpolation`, part of `make validate`; solves that are done are kept.
"""


def _solve(inputs: tuple[float, float]) -> None:
    stored_press(entry_inputs(*inputs))


def main() -> None:
    """Solve what is missing, compare, write the page."""
    os.environ[CACHE_VARIABLE] = str(BUILD)
    jobs = [(layer, ratio) for layer in BETWEEN for ratio in POISSON_RATIOS]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for done, _ in enumerate(pool.map(_solve, jobs), start=1):
            print(f"solved {done} of {len(jobs)}", flush=True)
    text = page([line for layer in BETWEEN for line in rows(layer)])
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
