"""A ball pressed into a rectangular pad and moved along x with friction: half the pad, in three dimensions.

The plane y = 0 through the middle of the pad and of the ball is a plane of symmetry. Solid and normal contact are those
of `object_press`, the steps along x and friction those of `slide_oracle`. Lengths in mm, stresses in E.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator
from skfem import MeshHex

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_surface import GapFunction
from tests.validation.elements.block_oracle import _top_of
from tests.validation.elements.hyperelastic import Solid, Spatial
from tests.validation.held.object_press import REACH_MM, TOUCHING_MM, WINDOW_MM
from tests.validation.held.rounded_objects import Distance, RigidObject
from tests.validation.held.slide_oracle import Slide


class ObjectSlide(Slide):
    """Half a pad under an object that is symmetric across y = 0."""

    copies = 2
    window, touching = WINDOW_MM, TOUCHING_MM
    largest_step = 0.25
    shear_step = 0.1
    penalty = final_penalty = 30.0
    stiffness = 300.0

    def __init__(self, thing: RigidObject, ticks: tuple[FloatArray, ...], poisson_ratio: float) -> None:
        self.thing = thing
        x, y, z = ticks
        solid = Solid(
            MeshHex.init_tensor(np.concatenate([-x[:0:-1], x]), y, -z[::-1]), poisson_ratio, Spatial()
        )
        x, y, z = solid.nodes
        far = [axis[-1] - 1e-9 for axis in ticks]
        bonded = np.flatnonzero((np.abs(x) > far[0]) | (y > far[1]) | (z < -far[2]))
        mirrored = 3 * np.flatnonzero(y < 1e-9) + 1
        self.top_nodes = np.flatnonzero(np.abs(z) < 1e-9)
        fixed = np.concatenate([(3 * bonded[:, None] + np.arange(3)).ravel(), mirrored])
        super().__init__(solid, _top_of(solid, REACH_MM), fixed, 3 * bonded + 2)

    def gap(self, depth: float) -> GapFunction:
        """Distance of points (..., 3) to the object at a depth and its place along x, with derivatives."""
        moved = np.array([self.shear, 0.0, -depth])

        def found(points: FloatArray) -> Distance:
            return self.thing.distance(points - moved)

        return found

    def lines(self) -> dict[str, FloatArray]:
        """The deformed top along x in the middle plane, and along y at the object's place."""
        top = (self.solid.nodes.T + self.solid.moved(self.state))[self.top_nodes]
        both = np.concatenate([top, top[top[:, 1] > 1e-9] * (1.0, -1.0, 1.0)])
        height = CloughTocher2DInterpolator(both[:, :2], both[:, 2])
        ways = {"along": np.array([[1.0], [0.0]]), "across": np.array([[0.0], [1.0]])}
        found = {}
        for name, way in ways.items():
            at = np.arange(-15.5, 15.6, 0.02)
            x, y = way * at + (1.0 - way) * np.array([[self.shear], [0.0]])
            found[name] = np.stack([at, height(x, y)])
        return found
