"""Solutions of the crowned oracle, and the command that makes them.

    python -m tests.validation.contact.crown.crown_reference

presses a tip at the apex of crowned layers, three tip radii thick there, and writes `crown_reference.npz`. Finished
states are kept in `build/validation/`, so that an interrupted run continues: 20 minutes on one core. Lengths are in
radii R of a tip of 3 mm, forces in E R².

* `CROWNS`: two pads that stand for real ones. Their model presses are compared in `crown_table`.
* `SERIES`: the pad of the sharper crown at several curvatures, flat among them, on one mesh.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import (
    FIELDS,
    POISSON_RATIO,
    CoarserState,
    ReferenceState,
    solved_states,
)
from tests.validation.contact.crown.crown_oracle import CrownedPress
from tests.validation.elements.layer_mesh import Grading

STORED = Path(__file__).with_name("crown_reference.npz")
TIP_MM = 3.0
LAYER = 9.0 / TIP_MM
DEPTHS = tuple(depth / TIP_MM for depth in (0.2, 0.5, 1.0, 2.0, 3.0))
HALVINGS = 2
"""How often the coarsest mesh is halved: elements of 0.025 tip radii at the contact."""
RECIPE = 2
"""Version of the oracle behind states kept in the build folder. Raise it when results change."""


@dataclass(frozen=True)
class Pad:
    """A round crowned pad, `LAYER` thick at the apex, under a tip; lengths in radii R of a tip of 3 mm.

    Attributes
    ----------
    curvature : R over the crown's radius; 0 is flat
    wall : radius of the bonded wall
    """

    curvature: float
    wall: float


SHARP = Pad(TIP_MM / 14.0, 11.0 / TIP_MM)
"""A fingertip's dome: crown of 14 mm on a disc of 22 mm."""
MILD = Pad(TIP_MM / 40.0, 17.0 / TIP_MM)
"""A crown of 40 mm on a disc of 34 mm."""
CROWNS = (MILD, SHARP)
SERIES = tuple(Pad(curvature, SHARP.wall) for curvature in (0.0, 0.05, 0.1, 0.15, SHARP.curvature, 0.25))


def solve_pad(pad: Pad, halvings: int) -> dict[float, list[dict[str, FloatArray]]]:
    """The states of a pad on a chain of meshes, solved or read.

    Returns
    -------
    depth [R] -> arrays on each mesh, coarsest first.
    """
    grading, size = Grading(), (LAYER, pad.wall, pad.curvature)
    inputs = json.dumps([size, POISSON_RATIO, asdict(grading), RECIPE])
    stem = f"crown-{pad.curvature:.3f}-1.000-{sha256(inputs.encode()).hexdigest()[:8]}"
    states = solved_states(
        stem,
        DEPTHS,
        halvings,
        lambda level: CrownedPress(*size, grading, POISSON_RATIO, level),
    )
    return dict(zip(DEPTHS, states.values(), strict=True))


def build(path: Path = STORED) -> None:
    """Solve everything and write the stored file."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for pad in dict.fromkeys((*CROWNS, *SERIES)):
        for depth, levels in solve_pad(pad, HALVINGS).items():
            name, fine, half = _name(pad, depth), levels[-1], levels[-2]
            kept = ("nodes", "contact", "rest_radii", *FIELDS)
            arrays |= {f"{name}/{field}": fine[field] for field in kept}
            arrays |= {f"{name}/half_{field}": half[field] for field in ("nodes", "force", "energy")}
    provenance = {
        "model": "axisymmetric neo-Hookean, Q2/Q1 displacement-pressure, spherically crowned top",
        "poisson_ratio": POISSON_RATIO,
        "layer": LAYER,
        "grading": asdict(Grading()),
        "command": "python -m tests.validation.contact.crown.crown_reference",
        "versions": {name: version(name) for name in ("scikit-fem", "numpy", "scipy")},
    }
    np.savez_compressed(path, provenance=np.array(json.dumps(provenance)), **arrays)


def _name(pad: Pad, depth: float) -> str:
    """What the arrays of a state begin with."""
    return f"{pad.curvature:.4f}-{pad.wall:.4f}-1.0000-{depth:.4f}"


@cache
def _stored(path: Path) -> dict[str, FloatArray]:
    with np.load(path, allow_pickle=False) as held:
        return {name: held[name] for name in held.files}


def crown_state(pad: Pad, depth: float, path: Path = STORED) -> ReferenceState:
    """The stored solution of a pad and depth [R]; heights are above the untouched apex.

    Raises
    ------
    KeyError : not among the stored ones
    """
    held = {
        name.partition("/")[2]: array
        for name, array in _stored(path).items()
        if name.startswith(f"{_name(pad, depth)}/")
    }
    if not held:
        raise KeyError(f"no stored solution for {pad}, depth {depth:g}")
    half = CoarserState(
        force=float(held["half_force"]), energy=float(held["half_energy"]), nodes=held["half_nodes"]
    )
    return ReferenceState(
        layer=LAYER,
        depth=depth,
        force=float(held["force"]),
        energy=float(held["energy"]),
        nodes=held["nodes"],
        rest_radii=held["rest_radii"],
        contact=held["contact"],
        half=half,
    )


if __name__ == "__main__":
    build()
