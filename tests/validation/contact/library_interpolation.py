"""Error of the contact library between its entries, and the command that measures it.

    python -m tests.validation.contact.library_interpolation

solves layers halfway between entries, and crowned pads between the solved ones, on the library's own mesh, compares
them with what the library interpolates, and writes docs/validation/contact-interpolation.md. Finished solves are kept
in `build/validation/`, so that an interrupted run continues: 30 minutes on one core. Lengths are in tip radii R.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import cKDTree

from optopad.sims.contact.library.live_press import fit_press
from optopad.sims.contact.library.profile_library import LAYERS, shipped_library
from optopad.sims.contact.library.smooth_press import POISSON_RATIOS, SmoothPress, nearly_incompressible
from optopad.sims.contact.library.stored_press import CACHE_VARIABLE, PressInputs, stored_press
from optopad.sims.contact.scope import solved_depths
from tests.validation.contact.contact_reference import BUILD
from tests.validation.contact.library_build import entry_inputs, entry_press

PAGE = BUILD.parents[1] / "docs" / "validation" / "contact-interpolation.md"
BETWEEN = tuple(2.0 / (1.0 / LAYERS[k] + 1.0 / LAYERS[k + 1]) for k in (1, 4, 6, 10))
"""Layers halfway between entries in 1/layer, where the interpolation is weakest: thin, corner, usual, thick."""
CROWNED = ((4.5, 5.5, 1 / 9), (3.0, 3.95, 0.2), (2.5, 4.6, 0.13), (3.0, 7.5, 0.08))
"""Layer, radius of the wall and crown (tip radius over the crown's) between the solved ones; the first is that of
the preset of a domed fingertip, the second nearly the most curved crown, the third a thin layer, the fourth the
largest pad."""
DEPTH_SHARES = (0.04, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
CROWNED_DEPTHS = (0.25, 0.5, 1.0)
"""Depths of the crowned presses [tip radii]."""
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


def errors(found: SmoothPress, solved: SmoothPress, depth: float) -> tuple[float, ...]:
    """Errors at a depth [tip radii]: force [%], surface rms and largest, edge [um]."""
    apart = distances_um(found, solved, depth)
    force = 100.0 * (found.force_at(depth) / solved.force_at(depth) - 1.0)
    edge = (found.edge_at(depth) - solved.edge_at(depth)) * TIP_UM
    return force, float(np.sqrt(np.mean(apart**2))), float(apart.max()), edge


def rows(layer: float) -> list[tuple[float, ...]]:
    """For every depth of a layer: layer and depth [R], and its `errors`."""
    solved, found = entry_press(layer), shipped_library().press(layer)
    depths = [share * found.deepest for share in DEPTH_SHARES]
    return [(layer, depth, *errors(found, solved, depth)) for depth in depths]


def crowned_inputs(layer: float, poisson_ratio: float, wall: float, crown: float) -> PressInputs:
    """What the solve of a crowned pad depends on: the library's, to the deepest of `CROWNED_DEPTHS`."""
    depths = tuple(round(float(depth), 9) for depth in solved_depths(layer, max(CROWNED_DEPTHS)))
    return replace(entry_inputs(layer, poisson_ratio, wall, crown), depths=depths)


def crowned_rows(pad: tuple[float, float, float]) -> list[tuple[float, ...]]:
    """For every depth of a crowned pad: layer, wall, crown and depth [R], and its `errors`."""
    layer, wall, crown = pad
    soft, stiff = (
        fit_press(stored_press(crowned_inputs(layer, ratio, wall, crown))[0]) for ratio in POISSON_RATIOS
    )
    solved, found = nearly_incompressible(soft, stiff), shipped_library().press(*pad)
    return [(*pad, depth, *errors(found, solved, depth)) for depth in CROWNED_DEPTHS]


def crowned_table(lines: Sequence[tuple[float, ...]]) -> str:
    """The rows of the table of crowned pads."""
    return "\n".join(
        f"| {layer:.3f} | {wall:.3f} | {crown:.3f} | {depth:.3f} | {off:+.2f} | {rms:.2f} | {most:.2f} | {edge:+.1f} |"
        for layer, wall, crown, depth, off, rms, most, edge in lines
    )


def page(lines: Sequence[tuple[float, ...]], crowned: Sequence[tuple[float, ...]]) -> str:
    """The whole page."""
    force, rms, largest, edge = np.abs(np.array(lines)[:, 2:]).max(axis=0)
    crowned_force, crowned_rms, crowned_largest, _ = np.abs(np.array(crowned)[:, 4:]).max(axis=0)
    return PAGE_TEXT.format(
        force=force,
        rms=rms,
        largest=largest,
        edge=edge,
        rows="\n".join(
            f"| {layer:.3f} | {depth:.3f} | {off:+.2f} | {rms:.2f} | {most:.2f} | {edge:+.1f} |"
            for layer, depth, off, rms, most, edge in lines
        ),
        crowned_force=crowned_force,
        crowned_rms=crowned_rms,
        crowned_largest=crowned_largest,
        crowned_rows=crowned_table(crowned),
    )


PAGE_TEXT = """\
# Interpolation in the contact library

**Question.** The shipped contact library holds solved presses of twelve layers, and of crowned pads. How far off is a
press between them?

**Answer.** Force by {force:.2f} % at most, the surface by {rms:.1f} µm rms and {largest:.0f} µm at the worst point,
the contact's edge by up to {edge:.0f} µm, for a tip of 3 mm. Of force and surface that is no more than the error of the
solver itself ([contact.md](contact.md)).
Under a crown, force by {crowned_force:.2f} % at most, the surface by {crowned_rms:.1f} µm rms and
{crowned_largest:.0f} µm at the worst point.

## Method

- Four layers, from thin to thick, halfway between two entries in 1/layer, where interpolation is least accurate. Each
  has seven depths.
- Each is solved on the library's own mesh and compared with what the library interpolates. So the figures hold the
  interpolation and the jitter of two solves, not the error of the solver.
- These are in a round pad with its wall at 16/3 tip radii.
- Crowned pads, pressed at their apex, lie between the solved layers, walls and crowns at once. The first is the domed
  fingertip's.

## Figures

Layer and depth in tip radii R; micrometres for a tip of 3 mm.

| layer / R | depth / R | force % | surface rms um | surface largest um | contact edge um |
|---|---|---|---|---|---|
{rows}

Crowned pads; the crown is the tip's radius over the crown's.

| layer / R | wall / R | crown | depth / R | force % | surface rms um | surface largest um | contact edge um |
|---|---|---|---|---|---|---|---|
{crowned_rows}

## What it means

- A layer between two entries is about as good as an entry: no need to choose a thickness that the library holds.
- The contact's edge is the least accurate near the shank of the tip, from about one tip radius of depth on.
- The effect of another wall is interpolated between four layers only and is not measured here;
  [the model's page](../understand/model.md) has what is known of it.

## Made by

`python -m tests.validation.contact.library_interpolation`, part of `make validate`; solves that are done are kept.
`python -m tests.validation.contact.library_build` computes the library itself: two hours or more on two cores.
"""


def _solve(inputs: PressInputs) -> None:
    stored_press(inputs)


def main() -> None:
    """Solve what is missing, compare, write the page."""
    os.environ[CACHE_VARIABLE] = str(BUILD)
    jobs = [entry_inputs(layer, ratio) for layer in BETWEEN for ratio in POISSON_RATIOS]
    jobs += [
        crowned_inputs(layer, ratio, wall, crown)
        for layer, wall, crown in CROWNED
        for ratio in POISSON_RATIOS
    ]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        for done, _ in enumerate(pool.map(_solve, jobs), start=1):
            print(f"solved {done} of {len(jobs)}", flush=True)
    text = page(
        [line for layer in BETWEEN for line in rows(layer)],
        [line for pad in CROWNED for line in crowned_rows(pad)],
    )
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
