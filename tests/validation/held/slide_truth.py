"""Objects that are pressed and then moved sideways with friction, with finite strains; the command renews `slide.csv`.

    python -m tests.validation.held.slide_truth              all cases, half an hour
    python -m tests.validation.held.slide_truth CASE ...     those whose name begins so; the other rows stay

Model: that of `truth`, with Coulomb friction. The object is pressed without friction, and where the case says so with
it; then it is moved along x at its depth. Each state is solved on two meshes: elements are halved in plane strain, and
1.4 times as large in three dimensions. Forces are over Young's modulus; those of long objects are per length. Heights
are those of the deformed top over fixed places, above the untouched top.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from copy import copy
from dataclasses import astuple, dataclass, fields
from itertools import pairwise
from pathlib import Path
from time import perf_counter

import numpy as np

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.elements.layer_mesh import Grading
from tests.validation.elements.newton import OracleError
from tests.validation.elements.tip_outlines import sphere_tip
from tests.validation.held.object_cases import DOWN, OBJECT_CASES, PAD_MM
from tests.validation.held.object_slide import ObjectSlide
from tests.validation.held.plane_cases import LAYER_MM
from tests.validation.held.slide_oracle import PlaneSlide, Slide

STORED = Path(__file__).with_name("slide.csv")
SHEARS_MM = (0.0, 0.1, 0.2, 0.3, 0.5)
PLACES_MM = np.arange(-15.0, 15.1, 0.5)
"""Places along a line at which heights are kept."""
BALL = "ball, radius 3"


@dataclass(frozen=True, kw_only=True)
class SlideCase:
    """An object, how deep it is pressed, and its coefficients of friction.

    Attributes
    ----------
    radius_mm : of a long cylinder; None is the ball
    is_rubbed : whether the press has friction too
    """

    radius_mm: float | None = None
    depths_mm: tuple[float, ...] = (1.0, 2.0)
    frictions: tuple[float, ...] = (0.3, 0.8)
    is_rubbed: bool = False

    @property
    def unit_mm(self) -> float:
        """Length that the press counts in."""
        return self.radius_mm or 1.0

    @property
    def power(self) -> int:
        """Of the unit, in a force over Young's modulus."""
        return 2 if self.radius_mm is None else 1

    def presses(self) -> list[Slide]:
        """The untouched pad on a coarse and on a fine mesh."""
        if (radius := self.radius_mm) is not None:
            width = 0.5 * 32.0 / radius
            return [
                PlaneSlide(LAYER_MM / radius, width, Grading(), POISSON_RATIO, sphere_tip(), level)
                for level in (0, 1)
            ]
        ball = OBJECT_CASES[BALL]
        axes = list(zip((*ball.grading, DOWN), PAD_MM, strict=True))
        return [
            ObjectSlide(
                ball.thing, tuple(axis.ticks(length, coarser) for axis, length in axes), POISSON_RATIO
            )
            for coarser in ball.coarser
        ]


CASES = {
    "long cylinder, radius 5": SlideCase(radius_mm=5.0),
    "long cylinder, radius 2": SlideCase(radius_mm=2.0, depths_mm=(1.0,), frictions=(0.3,)),
    "long cylinder, radius 5, pressed with friction": SlideCase(
        radius_mm=5.0, depths_mm=(1.0,), is_rubbed=True
    ),
    BALL: SlideCase(depths_mm=(1.0,), frictions=(0.8,)),
}


@dataclass(frozen=True)
class Slid:
    """A line over the top of a slid object, and the whole state.

    Attributes
    ----------
    mesh : coarse or fine
    line : along x in the middle plane, or across: along y at the object's place
    force, pull : over Young's modulus, into the pad and along x; of long objects, per length
    slip_share : share of the contact that slips
    low_mm, high_mm : ends of the contact along x, in the middle plane
    height_mm : at `PLACES_MM`
    """

    case: str
    depth_mm: float
    friction: float
    shear_mm: float
    mesh: str
    line: str
    force: float
    pull: float
    slip_share: float
    low_mm: float
    high_mm: float
    height_mm: FloatArray


def slid(case: SlideCase, press: Slide, friction: float) -> Iterator[tuple[float, Slide]]:
    """A pressed object, moved to places along x one after the other."""
    press.friction = friction
    if not case.is_rubbed:
        press.remember()
    for shear_mm in SHEARS_MM:
        press.slide(shear_mm / case.unit_mm)
        yield shear_mm, press


def pressed(case: SlideCase, depth_mm: float, presses: list[Slide]) -> None:
    """Press deeper without friction; the finer mesh starts from the coarser one's state."""
    presses[0].advance(depth_mm / case.unit_mm)
    for coarse, fine in pairwise(presses):
        try:
            fine.adopt(coarse)
        except OracleError:  # too far from the coarser mesh's state
            fine.advance(depth_mm / case.unit_mm)


def solved(name: str, case: SlideCase) -> Iterator[Slid]:
    """All rows of a case."""
    presses = case.presses()
    for depth_mm in case.depths_mm:
        if not case.is_rubbed:
            pressed(case, depth_mm, presses)
        for friction in case.frictions:
            for mesh, press in zip(("coarse", "fine"), presses, strict=True):
                own = copy(press)
                if case.is_rubbed:
                    own.friction = friction
                    own.advance(depth_mm / case.unit_mm, lambda *_, own=own: own.kept())
                for shear_mm, there in slid(case, own, friction):
                    yield from rows(name, case, depth_mm, shear_mm, mesh, there)


def rows(
    name: str, case: SlideCase, depth_mm: float, shear_mm: float, mesh: str, press: Slide
) -> Iterator[Slid]:
    """The lines of one state."""
    state, unit = press.state_now(), case.unit_mm
    for line, curve in state.lines.items():
        yield Slid(
            name,
            depth_mm,
            press.friction,
            shear_mm,
            mesh,
            line,
            unit**case.power * state.force,
            unit**case.power * state.pull,
            state.slip_share,
            *(unit * edge for edge in state.edges),
            unit * np.interp(PLACES_MM / unit, *curve),
        )


def read_slides(path: Path = STORED) -> list[Slid]:
    """The stored rows."""
    with path.open(encoding="utf-8", newline="") as lines:
        return [
            Slid(
                row[0],
                *map(float, row[1:4]),
                *row[4:6],
                *map(float, row[6:11]),
                np.array(row[11:], np.float64),
            )
            for row in list(csv.reader(lines))[1:]
        ]


def write_slides(slides: list[Slid], path: Path = STORED) -> None:
    """Write all rows, to the digits that mean something."""
    with path.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        heads = [field.name for field in fields(Slid)][:-1]
        writer.writerow([*heads, *(f"height at {at:g} mm" for at in PLACES_MM)])
        for one in slides:
            *most, heights = astuple(one)
            writer.writerow([*most[:6], *(f"{x:.5f}" for x in most[6:]), *(f"{z:.4f}" for z in heights)])


def renew(begins: list[str]) -> None:
    """Solve the cases whose names begin so; each is stored once it is done."""
    for name, case in CASES.items():
        if not name.startswith(tuple(begins)):
            continue
        start, found = perf_counter(), list[Slid]()
        for row in solved(name, case):
            found.append(row)
            print(f"{perf_counter() - start:6.0f} s  {row.mesh} {row.line} {astuple(row)[:-1]}", flush=True)
            held = {one: list[Slid]() for one in CASES}
            for one in read_slides() if STORED.exists() else []:
                held[one.case].append(one)
            held[name] = found
            write_slides([one for kept in CASES for one in held[kept]])


if __name__ == "__main__":
    renew(sys.argv[1:] or [""])
