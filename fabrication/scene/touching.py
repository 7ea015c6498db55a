"""Finds what touches a pad in a MuJoCo scene: the objects in contact with the pad's top, and where they are.

A geom of any body counts while MuJoCo reports its contact with the pad's top: spheres, capsules, ellipsoids, cylinders,
boxes, planes, and meshes by their convex hull, as MuJoCo's collisions take them. Height fields, signed distance fields
and flexible bodies have no shape here; the first one is named in a warning.

Positions are those of the latest kinematics. After `mj_step` MuJoCo's own are of the beginning of that step, as are its
sensors'; `mj_forward` renews them.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.fabrication.scene.contact_fit import DESIGN, prefixed, tuned
from optopad.sims.robot.shapes import Shape, hull_of

if TYPE_CHECKING:
    from mujoco import MjData, MjModel

MM_PER_M = 1e3
REACH_MM = 30.0
"""Distance at which a turn of a plane counts: about the size of a pad."""
CAVITY = "pad_cavity"
"""Name of the site of the cavity frame."""

_KINDS = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}
_OUTWARD = np.array([[0.0, 0.0, 1.0, 0.0]])
"""The half-space below a plane's own z axis, as a hull."""


@dataclass(frozen=True, kw_only=True)
class Touching:
    """The objects that touch a pad at one time.

    Attributes
    ----------
    geoms : numbers of their geoms in the model
    centre_mm, turn : (3,) centres and (3, 3) rotations in the cavity frame, for each; columns are the objects' axes.
        The frame of a unit with a higher top is as much higher
    pressed_mm : largest depth of its contacts by MuJoCo, for each
    reach_mm : distance of its farthest point from its centre, `REACH_MM` of a plane, for each
    """

    geoms: tuple[int, ...] = ()
    centre_mm: tuple[FloatArray, ...] = ()
    turn: tuple[FloatArray, ...] = ()
    pressed_mm: tuple[float, ...] = ()
    reach_mm: tuple[float, ...] = ()

    def moved_mm(self, other: Touching) -> float:
        """About the longest way of a point of the objects to another time; infinite if other objects touch then."""
        if self.geoms != other.geoms:
            return math.inf
        ways = zip(self.centre_mm, other.centre_mm, self.turn, other.turn, self.reach_mm, strict=True)
        return max(
            (
                math.dist(here, there) + reach * float(np.abs(turn - turned).max())
                for here, there, turn, turned, reach in ways
            ),
            default=0.0,
        )


NOTHING = Touching()


class PadTop:
    """The top of one pad of a compiled model.

    Its contact is tuned, so that forces follow the contact model (`contact_fit.tuned`).

    Parameters
    ----------
    model : compiled model
    name : name of the pad, which is its prefix without the underscore; "" for a pad without a prefix
    digest : digest of the pad's design
    raised_mm : height by which the unit's top is above that of the design; the model's top is moved there
    stiffness : factor of all forces, for objects that are unlike a ball of the tip's radius [-]

    Raises
    ------
    InputError : the model has no pad of this name, or one of another design; or its time step is too long.
    """

    def __init__(
        self, model: MjModel, name: str, digest: str, *, raised_mm: float = 0.0, stiffness: float = 1.0
    ) -> None:
        self._model, self._geom = model, tuned(model, name, stiffness=stiffness)
        self._site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, prefixed(name, CAVITY))
        text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, prefixed(name, DESIGN))
        if min(self._site, text) < 0:
            raise InputError(
                f"name: the pad {name!r} lacks {prefixed(name, CAVITY)} or {prefixed(name, DESIGN)}; keep all names of "
                "the file that `optopad scene` writes"
            )
        begin = model.text_adr[text]
        found = model.text_data[begin : begin + model.text_size[text] - 1].decode()
        if found != digest:
            raise InputError(
                f"design: {digest[:8]}, but the model's pad {name!r} is of design {found[:8]}; give its design, or "
                "write the pad's file again with `optopad scene`"
            )
        model.body_pos[model.geom_bodyid[self._geom]] = 0.0, 0.0, raised_mm / MM_PER_M
        self._raised_mm = np.array([0.0, 0.0, raised_mm])
        self._has_warned = False
        self.forget()

    def forget(self) -> None:
        """Read the shapes of geoms anew, because the model's sizes may have changed."""
        self._shapes: dict[int, Shape | None] = {}
        bounds_mm = self._model.geom_rbound * MM_PER_M  # 0 for planes, which have none
        self._reach_mm = np.where(bounds_mm > 0.0, bounds_mm, REACH_MM).tolist()

    def touching(self, data: MjData) -> Touching:
        """The objects that touch the pad now."""
        if not data.ncon:
            return NOTHING
        own, pressed_mm = self._geom, dict[int, float]()
        depths_mm = data.contact.dist * -MM_PER_M
        for (one, other), depth_mm in zip(data.contact.geom.tolist(), depths_mm.tolist(), strict=True):
            if own in (one, other):
                geom = one + other - own
                pressed_mm[geom] = max(pressed_mm.get(geom, -np.inf), depth_mm)
        geoms = tuple(geom for geom in sorted(pressed_mm) if self.shape(geom) is not None)
        if not geoms:
            return NOTHING
        origin = data.site_xpos[self._site]
        axes = data.site_xmat[self._site].reshape(3, 3)
        return Touching(
            geoms=geoms,
            centre_mm=tuple(
                (data.geom_xpos[geom] - origin) @ axes * MM_PER_M - self._raised_mm for geom in geoms
            ),
            turn=tuple(axes.T @ data.geom_xmat[geom].reshape(3, 3) for geom in geoms),
            pressed_mm=tuple(pressed_mm[geom] for geom in geoms),
            reach_mm=tuple(self._reach_mm[geom] for geom in geoms),
        )

    def shape(self, geom: int) -> Shape | None:
        """Shape of a geom; None, after a warning, if it has none."""
        if geom not in self._shapes:
            self._shapes[geom] = self._made(geom)
        return self._shapes[geom]

    def geom_name(self, geom: int) -> str:
        """Name of a geom, or its number, for messages."""
        return mujoco.mj_id2name(self._model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"number {geom}"

    def _made(self, geom: int) -> Shape | None:
        if geom < 0:
            self._warn_of("a flexible body")
            return None
        model = self._model
        kind = mujoco.mjtGeom(model.geom_type[geom])
        if kind in _KINDS:
            return Shape(kind=_KINDS[kind], size_mm=model.geom_size[geom] * MM_PER_M)
        if kind == mujoco.mjtGeom.mjGEOM_PLANE:
            return Shape(kind="hull", size_mm=np.zeros(3), planes=_OUTWARD)
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            return hull_of(model.mesh_vert[first : first + count] * MM_PER_M)
        self._warn_of(f"the geom {self.geom_name(geom)} ({kind.name.removeprefix('mjGEOM_').lower()})")
        return None

    def _warn_of(self, what: str) -> None:
        if not self._has_warned:
            self._has_warned = True
            warnings.warn(
                f"{what} touches the pad, and the frames do not show it: the simulation of light does not know its "
                "shape; use a primitive geom or a convex mesh",
                stacklevel=5,
            )
