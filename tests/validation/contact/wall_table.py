"""The table of the wall correction's errors in docs/validation/contact.md.

python -m tests.validation.contact.wall_table
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sims.contact.walls.near_walls import wall_correction
from tests.validation.contact.contact_table import PAGE, markdown_table, with_table
from tests.validation.contact.wall_reference import DEPTHS, LAYER, PLACES, wall_change

BEGIN, END = "<!-- made by tests/validation/contact/wall_table.py -->", "<!-- end of walls -->"
RADIUS_MM = 3.0
FORCE_LIMIT = 0.04
HEIGHT_LIMIT_UM = 30.0
HEAD = [
    "place",
    "depth mm",
    "force: oracle %",
    "model %",
    "model over oracle %",
    "height: largest change µm",
    "model off by, rms µm",
    "largest µm",
    "oracle's meshes: force %",
    "height, largest µm",
]


@dataclass(frozen=True, kw_only=True)
class WallError:
    """The correction at one place and depth against the oracle; force as a factor on that of the middle.

    Attributes
    ----------
    oracle_factor, model_factor : force over that of the middle [-]
    oracle_change_um : change of height at the compared places, largest
    height_rms_um, height_largest_um : model less oracle
    mesh_factor, mesh_height_um : the oracle's coarser mesh over and less its finer one, the latter the largest
    """

    place: str
    depth_mm: float
    oracle_factor: float
    model_factor: float
    oracle_change_um: float
    height_rms_um: float
    height_largest_um: float
    mesh_factor: float
    mesh_height_um: float

    @property
    def force_ratio(self) -> float:
        """Modelled over the oracle's factor."""
        return self.model_factor / self.oracle_factor


def wall_error(place: str, depth: float) -> WallError:
    """Compare the correction with the oracle; a plane of symmetry stands for a wall as far as the opposite one."""
    west, east, south, north = PLACES[place]
    oracle, half = wall_change(place, depth), wall_change(place, depth, half=True)
    correction = wall_correction(LAYER, depth, (west, east, south or north, north))
    to_um = 1e3 * RADIUS_MM
    off_um = to_um * (correction.height(oracle.x, oracle.y) - oracle.change)
    return WallError(
        place=place,
        depth_mm=RADIUS_MM * depth,
        oracle_factor=oracle.force_factor,
        model_factor=correction.force_factor,
        oracle_change_um=to_um * float(np.abs(oracle.change).max()),
        height_rms_um=float(np.sqrt((off_um**2).mean())),
        height_largest_um=float(np.abs(off_um).max()),
        mesh_factor=half.force_factor / oracle.force_factor,
        mesh_height_um=to_um * float(np.abs(half.change - oracle.change).max()),
    )


def wall_errors() -> list[WallError]:
    """Every place and depth."""
    return [wall_error(place, depth) for place in PLACES for depth in DEPTHS]


def _cells(error: WallError) -> list[str]:
    return [
        error.place,
        f"{error.depth_mm:g}",
        f"{100.0 * (error.oracle_factor - 1.0):+.2f}",
        f"{100.0 * (error.model_factor - 1.0):+.2f}",
        f"{100.0 * (error.force_ratio - 1.0):+.2f} ({100.0 * FORCE_LIMIT:g})",
        f"{error.oracle_change_um:.0f}",
        f"{error.height_rms_um:.1f}",
        f"{error.height_largest_um:.1f} ({HEIGHT_LIMIT_UM:g})",
        f"{100.0 * (error.mesh_factor - 1.0):+.2f}",
        f"{error.mesh_height_um:.1f}",
    ]


def main() -> None:
    """Make the table."""
    table = markdown_table(HEAD, [_cells(error) for error in wall_errors()])
    print(table)
    page = with_table(PAGE.read_text(encoding="utf-8"), table, (BEGIN, END))
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
