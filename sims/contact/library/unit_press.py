"""Solve presses into one layer with MuJoCo, and pack the results as a `UnitPress`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version

import numpy as np

from optopad.sims.contact.library.smooth_press import contact_tolerance, surface_curve
from optopad.sims.contact.library.stored_press import UnitPress
from optopad.sims.contact.mesh import radial_mesh
from optopad.sims.contact.scope import WALL_RADIUS
from optopad.sims.contact.tip import HEMISPHERE, TipOutline
from optopad.sims.contact.wedge import WEDGE_ANGLE, solve_wedge


def solve_unit_press(
    layer_depth: float,
    mesh_size: float,
    depths: Sequence[float],
    poisson_ratio: float,
    on_step: Callable[[float], None] | None = None,
    tip: TipOutline = HEMISPHERE,
    wall_radius: float = WALL_RADIUS,
    crown: float = 0.0,
) -> UnitPress:
    """Press a tip of radius 1 into a layer of modulus 1.

    Parameters
    ----------
    layer_depth, mesh_size : layer thickness on the axis, and node spacing under the tip [tip radii]
    depths : increasing press depths [tip radii]
    poisson_ratio : Poisson's ratio of the layer [-]
    on_step : called with the fraction done (0 to 1)
    tip : outline of the pressing tip
    wall_radius : radius of the bonded wall [tip radii]
    crown : tip radius over the radius of a spherical top that is pressed at its apex; 0 is flat [-]

    Raises
    ------
    InputError, ModelScopeError : the crown is not finite or is negative, or leaves too thin a rim
    ContactSolveError : a state fails its checks
    """
    mesh = radial_mesh(layer_depth, wall_radius, mesh_size, crown)
    solution = solve_wedge(mesh, depths, poisson_ratio, on_step, tip)
    spacing = float(mesh.nodes[mesh.top[1], 0])
    tolerance = contact_tolerance(spacing, WEDGE_ANGLE)
    contact = [
        surface_curve(
            radius, height, float(depth), spacing=spacing, tolerance=tolerance, tip=tip, crown=crown
        ).contact_radius
        for radius, height, depth in zip(solution.radii, solution.heights, solution.depths, strict=True)
    ]
    checks = {
        name: np.array([getattr(check, name) for check in solution.checks])
        for name in (
            "reaction",
            "penetration",
            "last_step",
            "chatter",
            "smallest_stretch",
            "volume_loss",
            "energy",
        )
    }
    return UnitPress(
        layer_depth=layer_depth,
        wall_radius=wall_radius,
        crown=crown,
        mesh_size=spacing,
        wedge_angle=WEDGE_ANGLE,
        poisson_ratio=poisson_ratio,
        tip_rows=np.array(tip.rows),
        depths=solution.depths,
        rest_radii=mesh.nodes[mesh.top, 0],
        radii=solution.radii,
        heights=solution.heights,
        normal_force=solution.normal_force,
        force=solution.force,
        contact_radius=np.array(contact),
        versions=(f"mujoco {version('mujoco')}",),
        **checks,
    )
