"""Presses at the apex of crowned pads: the model against the oracle.

    python -m tests.validation.contact.crown.crown_table

solves the model's presses (MuJoCo; kept in `build/validation/`, so that an interrupted run continues: a quarter of an
hour on one core), writes them to `crown_presses.npz`, and prints the table, which `crown_table.md` holds too. The
oracle's solutions are those of `crown_reference.npz`.

The tip radius is 3 mm, clear and black layer together are 9 mm at the apex. Surfaces are compared where they are, along
the normal; the untouched crown is the same in both. Limits were set before anything was solved: from 0.5 to 3 mm deep
surface 12 µm rms and force 4 %.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from optopad.sims.contact.library.stored_press import CACHE_VARIABLE
from optopad.sims.press import Indentation
from tests.validation.contact.contact_comparison import PressError, oracle_error, press_error
from tests.validation.contact.contact_reference import BUILD
from tests.validation.contact.contact_table import markdown_table
from tests.validation.contact.crown.crown_reference import (
    CROWNS,
    DEPTHS,
    LAYER,
    SERIES,
    TIP_MM,
    Pad,
    crown_state,
)
from tests.validation.contact.crown.crowned_press import CrownedPad, crowned_press

PRESSES = Path(__file__).with_name("crown_presses.npz")
FRAGMENT = PRESSES.with_name("crown_table.md")
TABLED = tuple(dict.fromkeys((*CROWNS, *(pad for pad in SERIES if pad.curvature))))
FORCE_LIMIT, SURFACE_LIMIT_UM = 0.04, 12.0
FIRST_LIMITED = 0.5 / TIP_MM
"""Depth from which the limits hold [tip radii]: a shallower contact spans three cells of the model's mesh."""
FIELDS = ("radius_mm", "height_mm", "inclination_deg", "contact_radius_mm", "force_n")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One press: the model against the oracle, and the oracle against its coarser mesh."""

    pad: Pad
    depth: float
    model: PressError
    oracle: PressError


def crowned_pad(pad: Pad) -> CrownedPad:
    """The pad in mm, its modulus 1 MPa."""
    return CrownedPad(
        tip_radius_mm=TIP_MM,
        crown_radius_mm=TIP_MM / pad.curvature,
        elastic_depth_mm=LAYER * TIP_MM,
        pad_radius_mm=pad.wall * TIP_MM,
        youngs_modulus_mpa=1.0,
    )


def _name(pad: Pad, depth: float) -> str:
    return f"{pad.curvature:.4f}-{pad.wall:.4f}-{depth:.4f}"


def solve(path: Path = PRESSES) -> None:
    """Solve the model's presses and write them, heights above the untouched apex."""
    os.environ[CACHE_VARIABLE] = str(BUILD)
    held: dict[str, np.ndarray] = {}
    for pad in TABLED:
        press = crowned_press(crowned_pad(pad), DEPTHS[-1] * TIP_MM)
        for depth in DEPTHS:
            found = press.absolute_at(depth * TIP_MM)
            held |= {f"{_name(pad, depth)}/{name}": np.array(getattr(found, name)) for name in FIELDS}
        print(f"crown of {TIP_MM / pad.curvature:g} mm: solved", flush=True)
    np.savez_compressed(path, versions=np.array([f"mujoco {version('mujoco')}"]), **held)


def model_press(pad: Pad, depth: float, path: Path = PRESSES) -> Indentation:
    """A stored press of the model, heights above the untouched apex; KeyError where there is none."""
    with np.load(path, allow_pickle=False) as stored:
        held = {name: stored[f"{_name(pad, depth)}/{name}"] for name in FIELDS}
    return Indentation(
        depth_mm=depth * TIP_MM,
        tip_radius_mm=TIP_MM,
        radius_mm=held["radius_mm"],
        height_mm=held["height_mm"],
        contact_radius_mm=float(held["contact_radius_mm"]),
        force_n=float(held["force_n"]),
        inclination_deg=held["inclination_deg"],
    )


def rows() -> Iterator[Row]:
    """Every press of the table."""
    for pad in TABLED:
        for depth in DEPTHS:
            state = crown_state(pad, depth)
            model = press_error(model_press(pad, depth), state, 1.0)
            yield Row(pad=pad, depth=depth, model=model, oracle=oracle_error(state, TIP_MM))


def exceeded(row: Row) -> list[str]:
    """What is above its limit, with both values; nothing at depths without limits."""
    if row.depth < FIRST_LIMITED - 1e-9:
        return []
    force, surface = abs(row.model.force_ratio - 1.0), row.model.surface_rms_um
    place = f"crown of {TIP_MM / row.pad.curvature:.3g} mm at {row.depth * TIP_MM:g} mm"
    found = [f"{place}: force {100 * force:.2f} % > {100 * FORCE_LIMIT:g} %"] if force > FORCE_LIMIT else []
    if surface > SURFACE_LIMIT_UM:
        found.append(f"{place}: surface {surface:.1f} µm > {SURFACE_LIMIT_UM:g} µm")
    return found


HEAD = [
    "crown mm",
    "pad mm",
    "rim mm",
    "depth mm",
    "force N",
    "force %",
    "surface rms µm",
    "largest µm",
    "rms to the wall µm",
    "largest to the wall µm",
    "slope rms °",
    "contact radius mm",
    "the oracle's mm",
]


def _cells(row: Row) -> list[str]:
    error, pad = row.model, row.pad
    drop = (1.0 - np.sqrt(1.0 - (pad.curvature * pad.wall) ** 2)) / pad.curvature
    return [
        f"{TIP_MM / pad.curvature:.3g}",
        f"{pad.wall * TIP_MM:g}",
        f"{(LAYER - drop) * TIP_MM:.2f}",
        f"{row.depth * TIP_MM:g}",
        f"{crown_state(pad, row.depth).force * TIP_MM**2:.3f}",
        f"{100.0 * (error.force_ratio - 1.0):+.2f}",
        f"{error.surface_rms_um:.1f}",
        f"{error.surface_largest_um:.1f}",
        f"{error.wall_rms_um:.1f}",
        f"{error.wall_largest_um:.1f}",
        f"{error.slope_rms_deg:.2f}",
        f"{error.contact_radius_mm:.3f}",
        f"{error.oracle_radius_mm:.3f}",
    ]


def markdown(found: list[Row]) -> str:
    """The table, what is above a limit, and what the oracle's own mesh errs."""
    above = [text for row in found for text in exceeded(row)]
    oracle = [row.oracle for row in found]
    return "\n\n".join(
        [
            f"Made with mujoco {version('mujoco')} and scikit-fem {version('scikit-fem')}. Modulus 1 MPa.",
            markdown_table(HEAD, [_cells(row) for row in found]),
            "Above a limit: " + ("; ".join(above) if above else "nothing") + ".",
            "The oracle's elements of 0.05 against those of 0.025 tip radii, the largest of all presses: force "
            f"{100.0 * max(abs(one.force_ratio - 1.0) for one in oracle):.2f} %, surface "
            f"{max(one.surface_rms_um for one in oracle):.1f} µm rms and "
            f"{max(one.wall_largest_um for one in oracle):.1f} µm at most.",
        ]
    )


def main() -> None:
    """Solve what is missing, compare, write."""
    solve()
    text = markdown(list(rows()))
    FRAGMENT.write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
