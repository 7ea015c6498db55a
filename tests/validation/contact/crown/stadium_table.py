"""Presses into a stadium pad: the model against three dimensions.

    python -m tests.validation.contact.crown.stadium_table

compares the contact model as it is with the solutions of `stadium_oracle`, and writes the table of
docs/validation/contact-crowns.md. Errors are those of `offset_table`: the model's surface less the oracle's along the
normal of the oracle's, from 0.3 mm outside the model's contact. A side is the quarter turn about its direction, within
3 tip radii.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from optopad.design.arrays import FloatArray
from optopad.design.preset import preset
from optopad.sims.contact.pad_surface import PadSurface, curve_height_mm, pad_surface
from optopad.sims.contact.scope import contact_of
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.contact.crown.offset_oracle import OffsetPad, offset_state
from tests.validation.contact.crown.offset_table import (
    NEAR,
    OFF_CONTACT_MM,
    OffsetError,
    Surface,
    error_of,
    figures,
    mesh_difference_um,
    surface,
)
from tests.validation.contact.crown.stadium_oracle import PADS, STORED

PAGE = Path(__file__).parents[4] / "docs" / "validation" / "contact-crowns.md"
MARKS = "<!-- made by tests/validation/contact/crown/stadium_table.py -->", "<!-- end -->"
DEEPEST_MM = max(PADS["middle"].depths_mm)
DESIGN = preset("gripper-stadium").with_(**{"operating.max_depth_mm": DEEPEST_MM})
STEP_MM = 0.25
"""Grid on which that part of the model is read that is no curve around the axis; it is smooth."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A difference from the oracle's surface; `along` is on the side of the farther end, then of the nearer one.

    Attributes
    ----------
    error : in the measures of `offset_table`
    along_um, across_um : mean on both sides towards the ends, and on those towards the straight walls
    """

    error: OffsetError
    along_um: tuple[float, float]
    across_um: float

    @classmethod
    def of(
        cls, pad: OffsetPad, top: Surface, difference_um: FloatArray, ratio: float, edge_mm: float
    ) -> Difference:
        """The measures of a difference (nx, ny) [µm] and a ratio of forces outside a contact of radius `edge_mm`."""
        error, radius = error_of(pad, top, difference_um, ratio, edge_mm), top.radius_mm
        across = (radius >= edge_mm + OFF_CONTACT_MM) & (radius <= NEAR * pad.tip_mm)
        across &= ~(top.side(1.0) | top.side(-1.0))
        mean = float(np.average(difference_um[across], weights=top.share[across]))
        return cls(error=error, along_um=(error.apex_um, error.rim_um), across_um=mean)


def pressed(pad: OffsetPad, depth_mm: float) -> PadSurface:
    """The model's press in the design, to be used as deep as the oracle's; or in the round pad of its area."""
    x, y = 0.5 * DESIGN.cavity.length_mm, 0.5 * DESIGN.cavity.width_mm
    found = pad_surface(DESIGN, depth_mm, (x + pad.offset_mm, y))
    if pad.straight_mm:
        return found
    return replace(found, near=found.solved.round_pad_at(depth_mm), solved=replace(found.solved, placed=None))


def model_difference_um(top: Surface, press: PadSurface) -> FloatArray:
    """(nx, ny) the model's surface less the oracle's, along its normal [µm]."""
    x, y = (np.linspace(0.0, size, round(size / STEP_MM) + 1) for size in press.size_mm)
    beside = RegularGridInterpolator(
        (x, y), press.beside_mm(x, y), "cubic", bounds_error=False, fill_value=0.0
    )
    places = top.points_mm[..., :2] + np.array(press.at_mm)
    modelled = curve_height_mm(press.near, top.radius_mm) + beside(places)
    return 1e3 * np.asarray((modelled - top.points_mm[..., 2]) * top.normals[..., 2])


@cache
def differences(name: str, depth_mm: float) -> tuple[Difference, Difference]:
    """The model's, and the oracle's coarser mesh's."""
    pad = PADS[name]
    fine, half = (offset_state(name, depth_mm, half=one, path=STORED) for one in (False, True))
    (top, _), press = surface(pad, fine), pressed(pad, depth_mm)
    force_n, edge_mm = float(fine.force_n[2]), press.near.contact_radius_mm
    model = (
        model_difference_um(top, press),
        press.near.force_n / contact_of(DESIGN).draft.modulus.value / force_n,
    )
    mesh = mesh_difference_um(pad, fine, half), float(half.force_n[2]) / force_n
    return Difference.of(pad, top, *model, edge_mm), Difference.of(pad, top, *mesh, edge_mm)


HEAD = [
    "pressed",
    "depth mm",
    "force, the oracle's N",
    "force",
    "surface to 3 tip radii: rms, largest µm",
    "whole pad: rms, largest µm",
    "mean towards the ends, the straight walls µm",
    "the oracle's coarser mesh: force, surface to 3 tip radii µm",
]
PLACES = {
    "middle": "the middle",
    "end": "the centre of a half round",
    "round": "(a round pad of its area)",
}


def _signed(number: float) -> str:
    return f"{round(number):+d}" if round(number) else "0"


def _row(name: str, depth_mm: float) -> list[str]:
    model, mesh = differences(name, depth_mm)
    sides = [_signed(one) for one in model.along_um][: 2 if PADS[name].offset_mm else 1]
    force, near, whole = figures(model.error)
    coarse, coarse_near, _ = figures(mesh.error)
    return [
        PLACES[name],
        f"{depth_mm:g}",
        f"{offset_state(name, depth_mm, path=STORED).force_n[2]:.3f}",
        f"{force} %",
        near,
        whole,
        f"{' and '.join(sides)}, {_signed(model.across_um)}",
        f"{coarse} %, {coarse_near}",
    ]


def markdown() -> str:
    """The table: a press a row."""
    return markdown_table(HEAD, [_row(name, depth) for name, pad in PADS.items() for depth in pad.depths_mm])


def main() -> None:
    """Write the table."""
    text = markdown()
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text, MARKS), encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
