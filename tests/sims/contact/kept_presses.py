"""Presses on a coarse mesh that the tests of this folder share, kept as files: solving them takes most of a minute.

`python -m tests.sims.contact.kept_presses` solves them and writes the files anew. Do that where the solver changes its
results: the slow test that solves live and compares says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np

from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.stored_press import PressInputs, UnitPress
from optopad.sims.contact.scope import contact_of
from tests.validation.contact.crown.crowned_press import CrownedPad, crowned_press

COARSE_MM = 0.45
FOLDER = Path(__file__).with_name("kept")
CROWNED_PAD = CrownedPad(
    tip_radius_mm=3.0, crown_radius_mm=14.0, elastic_depth_mm=6.0, pad_radius_mm=9.0, youngs_modulus_mpa=1.0
)
CROWNED_DEPTH_MM = 0.4


def check_design() -> SensorDesign:
    """8 mm elastic depth, 3 mm tip, 1 MPa: the case of the study's check values."""
    return preset("piacenza2017-pad").with_(
        **{
            "cavity.clear_thickness_mm": 7.0,
            "cavity.black_thickness_mm": 1.0,
            "indenter.tip_radius_mm": 3.0,
            "elastomer.youngs_modulus_mpa": 1.0,
            "operating.max_depth_mm": 3.0,
        }
    )


def kept_file(inputs: PressInputs) -> Path:
    """Where the press of some inputs is kept."""
    return FOLDER / f"{'crowned' if inputs.crown else 'flat'}-{inputs.poisson_ratio:g}.npz"


def kept_press(inputs: PressInputs) -> UnitPress | None:
    """The press kept for these inputs, or None where another one lies there, or none."""
    if not kept_file(inputs).is_file():
        return None
    with np.load(kept_file(inputs), allow_pickle=False) as file:
        held = {name: file[name] for name in file.files}
    versions = tuple(str(text) for text in held.pop("versions"))
    mesh_size = float(held.pop("asked_mesh"))  # the mesh's own spacing is a little finer
    press = UnitPress(
        versions=versions,
        **{name: array if array.ndim else float(array) for name, array in held.items()},
    )
    same = (
        press.depths.shape == np.shape(inputs.depths)
        and np.allclose(press.depths, inputs.depths, rtol=0.0, atol=1e-9)
        and np.array_equal(press.tip_rows, inputs.tip.rows)
        and np.allclose(
            [press.layer_depth, mesh_size, press.wall_radius, press.crown],
            [inputs.layer, inputs.mesh_size, inputs.wall_radius, inputs.crown],
            rtol=0.0,
            atol=1e-8,
        )
    )
    return press if same else None


def kept_or_solved(
    solve: Callable[[PressInputs, Callable[[float], None] | None], UnitPress],
) -> Callable[[PressInputs, Callable[[float], None] | None], UnitPress]:
    """In place of `stored_press._solve`: what is kept is not solved."""

    def kept_first(inputs: PressInputs, on_step: Callable[[float], None] | None) -> UnitPress:
        return kept_press(inputs) or solve(inputs, on_step)

    return kept_first


def solve_and_keep() -> None:
    """Solve what the tests share, and write the files."""
    solve = stored_press._solve

    def solve_and_write(inputs: PressInputs, on_step: Callable[[float], None] | None) -> UnitPress:
        press = solve(inputs, on_step)
        FOLDER.mkdir(exist_ok=True)
        arrays = {field.name: np.array(getattr(press, field.name)) for field in fields(press)}
        np.savez_compressed(
            kept_file(inputs), allow_pickle=False, asked_mesh=np.array(inputs.mesh_size), **arrays
        )
        return press

    stored_press._solve = solve_and_write
    stored_press.read_entry = lambda _key: None
    solved_press(contact_of(check_design()), mesh_mm=COARSE_MM)
    crowned_press(CROWNED_PAD, CROWNED_DEPTH_MM, COARSE_MM)


if __name__ == "__main__":
    solve_and_keep()
