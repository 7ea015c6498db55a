"""Rigid objects pressed into a pad, solved with finite strains; the command that renews `truth.csv`.

    python -m tests.validation.held.truth              all cases, hours
    python -m tests.validation.held.truth CASE ...     those whose name begins so; the other rows stay

Model: a neo-Hookean layer of 9 mm with Young's modulus 1 and Poisson's ratio 0.499, bonded to its floor and its walls
32 mm apart; a rigid object without friction pushed straight down; no gravity, no viscosity. Long objects are solved in
plane strain (`plane_oracle`), short ones in three dimensions (`object_press`). Heights are above the untouched top.
Every value comes from two meshes. The file holds the finer one's, and how far the coarser one is off: in plane strain,
where elements are halved, a few times the error that is left; in three dimensions, where they are 1.3 times as
large, about as much as is left.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from time import perf_counter

from tests.validation.elements.newton import OracleError
from tests.validation.held.object_cases import OBJECT_CASES, ObjectCase
from tests.validation.held.plane_cases import PLANE_CASES, PlaneCase
from tests.validation.held.truth_file import STORED, Row, read_truth, write_truth

CASES: dict[str, PlaneCase | ObjectCase] = {**PLANE_CASES, **OBJECT_CASES}


def solved_presses(case: PlaneCase | ObjectCase) -> Iterator[list[Row]]:
    """Press deeper and deeper on the coarsest mesh; each finer one starts from the coarser one's state."""
    presses = case.presses()
    for depth_mm in case.depths_mm:
        presses[0].advance(depth_mm / case.unit_mm)
        for coarse, fine in pairwise(presses):
            try:
                fine.adopt(coarse)
            except OracleError:  # too far from the coarser mesh's state: step by step from its own last one
                fine.advance(depth_mm / case.unit_mm)
        yield list(case.kept(depth_mm, *(press.state_now() for press in presses[-2:])))


def renew(
    begins: list[str], cases: Mapping[str, PlaneCase | ObjectCase] = CASES, stored: Path = STORED
) -> None:
    """Solve the cases whose names begin so; each press is stored once it is done."""
    for name, case in cases.items():
        if not name.startswith(tuple(begins)):
            continue
        start, rows = perf_counter(), list[Row]()
        for press in solved_presses(case):
            rows += press
            print(f"{perf_counter() - start:6.0f} s  {name}: {press[0]}", flush=True)
            held = (read_truth(stored) if stored.exists() else {}) | {name: rows}
            write_truth({one: held[one] for one in cases if one in held}, stored)


if __name__ == "__main__":
    renew(sys.argv[1:] or [""])
