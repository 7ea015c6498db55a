"""Sideways loads of the model against those with finite strains and friction, `slide.csv`.

    python -m tests.validation.held.slide_table              all tables of docs/validation/shear.md
    python -m tests.validation.held.slide_table light        one

Long objects lie in the long pad of `object_table`; their forces are those of the middle section. The ball is pressed
into the middle of the paper's pad. Heights are compared at fixed places, in three parts: behind the contact, in it and
0.5 mm beside it, and in front of it, the way the object moved.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import groupby, pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
from scipy.spatial.distance import cdist

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.sims.contact.held import press as model
from optopad.sims.contact.held.press import touched
from optopad.sims.contact.held.slide import STEP_MM, Slide
from optopad.sims.contact.scope import contact_of
from optopad.sims.held import AskedPress, held_light, pressed, slid_presses
from tests.validation.contact.contact_table import markdown_table, write_tables
from tests.validation.held.object_table import (
    END_MM,
    LENGTH_MM,
    MIDDLE,
    PAD,
    STRAIGHT_MM,
    Line,
    long_pad,
    rms,
    section_mm,
    size,
)
from tests.validation.held.plane_cases import PlaneCase
from tests.validation.held.slide_truth import CASES, PLACES_MM, SHEARS_MM, Slid, read_slides

BESIDE_MM = 0.5


@dataclass(frozen=True, kw_only=True)
class Modelled:
    """A state of the model, as of `Slid`."""

    force: float
    pull: float
    slip_share: float
    low_mm: float
    high_mm: float
    heights_mm: dict[str, FloatArray]


@cache
def modelled(name: str, depth_mm: float, friction: float) -> list[Modelled]:
    """The states of the model at `SHEARS_MM`, as far as it covers them."""
    radius = CASES[name].radius_mm
    if radius is None:
        contact, at = contact_of(preset(PAD)), MIDDLE
        x, y = model.grid_of(contact, at)
        bottoms = 3.0 - np.sqrt(np.maximum(9.0 - x[:, None] ** 2 - y**2, 0.0))
        bottoms[np.hypot(x[:, None], y) >= 3.0] = np.inf
        return list(_states(Slide(*touched(contact, at, bottoms), depth_mm, friction), False))
    with patch.object(model, "MOST_STEPS", round(LENGTH_MM / model.FINE.step_mm)):
        contact, at = long_pad(), (MIDDLE[0], 0.5 * LENGTH_MM)
        x, y = model.grid_of(contact, at)
        ends = np.maximum(np.abs(y) - 0.5 * STRAIGHT_MM, 0.0) ** 2 / (2.0 * END_MM)
        bottoms = section_mm(PlaneCase(half_width_mm=radius), x)[:, None] + ends
        return list(_states(Slide(*touched(contact, at, bottoms), depth_mm, friction), True))


def _states(slide: Slide, is_long: bool) -> Iterator[Modelled]:
    pad = slide.pad
    x, y = pad.x_mm, pad.y_mm
    middle = int(np.abs(y).argmin())
    part = np.s_[:, middle] if is_long else np.s_[:]
    cell = pad.step_mm if is_long else pad.step_mm**2
    for before, shear in pairwise((0.0, *SHEARS_MM)):
        count = int(np.ceil((shear - before) / STEP_MM - 1e-9))
        try:
            for share in np.arange(1, count + 1) / max(count, 1):
                slide.advance(np.array([before + share * (shear - before), 0.0]))
        except ModelScopeError:
            return
        found = slide.press()
        top, here = found.top, int(np.abs(x - shear).argmin())
        along, across = top.height_mm[:, middle], top.height_mm[here]
        edges = [
            sign * Line.of(sign * x[::sign], along[::sign], top.level[::sign, middle], force=0.0).edge_mm
            for sign in (-1, 1)
        ]
        slips = slide.is_slipping[part][slide.load[2][part] > 0.0]
        yield Modelled(
            force=float(found.pressure_mpa[part].sum() * cell / (3.0 * pad.shear_mpa)),
            pull=float(slide.load[0][part].sum() * cell / 3.0),
            slip_share=float(slips.mean()),
            low_mm=edges[0],
            high_mm=edges[1],
            heights_mm={"along": np.interp(PLACES_MM, x, along), "across": np.interp(PLACES_MM, y, across)},
        )


def compared(truth: Slid, coarse: Slid, state: Modelled) -> list[str]:
    """One row."""
    low, high = truth.low_mm - BESIDE_MM, truth.high_mm + BESIDE_MM
    if truth.line == "across":
        half = 0.5 * (high - low)
        low, high = -half, half
    off = 1e3 * (state.heights_mm[truth.line] - truth.height_mm)
    mesh = 1e3 * np.abs(coarse.height_mm - truth.height_mm)[(low > PLACES_MM) | (high < PLACES_MM)].max()
    parts = (low > PLACES_MM, (low <= PLACES_MM) & (high >= PLACES_MM), high < PLACES_MM)
    beside = off[parts[0] | parts[2]]
    return [
        truth.case,
        f"{truth.depth_mm:g}",
        f"{truth.friction:g}",
        f"{truth.shear_mm:g}",
        truth.line,
        f"{truth.force:.3f}",
        f"{100.0 * (state.force / truth.force - 1.0):+.1f}",
        f"{truth.pull:.3f}",
        f"{100.0 * (state.pull / truth.pull - 1.0):+.1f}" if truth.shear_mm else "",
        f"{100 * truth.slip_share:.0f}, {100 * state.slip_share:.0f}",
        f"{1e3 * (state.low_mm - truth.low_mm):+.0f}, {1e3 * (state.high_mm - truth.high_mm):+.0f}",
        f"{np.sqrt(np.mean(beside**2)):.0f}, {np.abs(beside).max():.0f}",
        f"{0.1 * np.abs(beside).max() / truth.depth_mm:.1f}",
        "; ".join(f"{off[part][np.abs(off[part]).argmax()]:+.0f}" for part in parts),
        f"{100.0 * abs(coarse.pull / truth.pull - 1.0):.1f}, {mesh:.0f}"
        if truth.shear_mm
        else f", {mesh:.0f}",
    ]


def refused(truth: Slid) -> list[str]:
    """The row of a state that the model does not cover."""
    first = [truth.case, f"{truth.depth_mm:g}", f"{truth.friction:g}", f"{truth.shear_mm:g}", truth.line]
    return [*first, f"{truth.force:.3f}", "refused", f"{truth.pull:.3f}", *[""] * (len(HEAD) - 8)]


HEAD = ["object", "depth mm", "friction", "shear mm", "line", "force/E", "force %", "pull/E", "pull %"]
HEAD += ["slips %: solved, model", "ends of the contact µm", "top beside the contact: rms, largest µm"]
HEAD += ["% of the depth", "largest behind; at; in front µm", "meshes: pull %, top µm"]


def contact() -> str:
    """A row for each stored line that was solved on a fine mesh."""
    body = []
    for (name, depth, friction), group in groupby(
        read_slides(), lambda row: (row.case, row.depth_mm, row.friction)
    ):
        states = modelled(name, depth, friction)
        kept = {(row.mesh, row.shear_mm, row.line): row for row in group}
        for (mesh, shear, line), row in kept.items():
            if mesh == "fine":
                at = SHEARS_MM.index(shear)
                body.append(
                    compared(row, kept["coarse", shear, line], states[at])
                    if at < len(states)
                    else refused(row)
                )
    return markdown_table(HEAD, body)


LIGHT_SHEARS_MM = (0.1, 0.3, 0.5)
BALL = "sphere,radius=3,friction="


def light() -> str:
    """Changes of light by a sideways motion, and by how much that of the opposite motion is not its image."""
    draft = Draft.of(preset(PAD))
    image = []
    for parts in (draft.cavity.emitters, draft.cavity.receivers):
        at = np.array([part.position_mm[:2] for part in parts]) - MIDDLE
        image.append(cdist(-at, at).argmin(axis=1))
    body = []
    for depth in (1.0, 2.0):
        asked = [
            AskedPress(held=(held_of(f"{BALL}{friction:g}"),), at_mm=MIDDLE, depth_mm=depth)
            for friction in (0.0, 0.8)
        ]
        path = np.outer(LIGHT_SHEARS_MM, (1.0, 0.0))
        slides = [slid_presses(draft, one, sign * path) for one in asked for sign in (1.0, -1.0)]
        presses = [pressed(draft, asked[0]), *(one for slide in slides for one in slide)]
        found = held_light(draft, presses, accuracy="score")
        flux = found.flux / found.untouched
        error = (found.error / found.untouched)[1:].reshape(4, len(LIGHT_SHEARS_MM), *flux.shape[1:])
        change = (flux[1:] - flux[0]).reshape(error.shape)
        mirrored = change[:, :, image[0]][:, :, :, image[1]]
        stated = np.hypot(error[2], error[3][:, image[0]][:, :, image[1]])
        for k, shear in enumerate(LIGHT_SHEARS_MM):
            drawn = 100.0 * np.sqrt(np.mean((change[2, k] - change[0, k]) ** 2))
            body.append(
                [
                    f"{depth:g}",
                    f"{shear:g}",
                    f"{np.hypot(*slides[2][k].pull_n):.2f}",
                    size(change[2, k]),
                    f"{drawn:.2f}",
                    size(mirrored[3, k] - change[2, k]),
                    rms(stated[k]),
                ]
            )
    return markdown_table(LIGHT_HEAD, body)


LIGHT_HEAD = ["depth mm", "shear mm", "pull N", "change by the motion: rms, largest %"]
LIGHT_HEAD += [
    "of it by friction: rms %",
    "opposite motion, turned by 180°, against it: rms, largest %",
    "stated: rms %",
]
TABLES = {"contact": contact, "light": light}
PAGE = Path(__file__).parents[3] / "docs" / "validation" / "shear.md"


if __name__ == "__main__":
    write_tables(PAGE, "tests/validation/held/slide_table.py", TABLES, sys.argv[1:])
