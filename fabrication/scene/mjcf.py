"""A pad as a MuJoCo model: collision, visual meshes, mass, mount, taxels and contact parameters.

    body  pad            origin: middle of the mold's underside; axes of the cavity, z out of the pad
      site  pad_mount    there, to attach it by
      site  pad_cavity   origin of the cavity's coordinates: z = 0 is the bottom of the clear layer
      geoms pad_mold, pad_silicone      what is seen, and the mass
      geoms pad_wall_1, ..., pad_core   collision of the mold, whose rim may be higher than the top, and of its core
      geom  pad_taxels   points at which the sensor measures; not seen, no collision
      body  pad_face     of its own, so that `contact_fit.tuned` can set the weight of its contacts alone
        geom pad_top     collision of the silicone: a box, or the convex hull of another outline or a crown
    sensor pad_tactile   penetration [m] and sliding speed along x and y [m/s] at the points of `taxels_mm`

Lengths are in m, as MuJoCo has them, and those of the cavity in mm. How far an object reaches into `pad_top` is the
depth of its press. `pad_top` has priority, so its contact parameters hold against every object of priority 0.

The core has a hard contact. It is the mold's floor with the lower part of the silicone, below the
depths of the contact's fit, so that nothing is pushed through the pad.

MuJoCo's tactile sensor takes its points in the axes of inertia of their mesh, and reads three vectors for each point
from the mesh's normals: normal and two tangents. So the points are a mesh on a geom of their own, whose frame MuJoCo
moves with these axes. The sensor reads 0 under an object that is a mesh, unless MuJoCo made an octree of the mesh. (The
frames of `simulated_pad` see such objects.)

The mass is that of the mold printed solid and of the silicone, by the densities of the catalogue. Left out: optical
parts, leads and the board, of which the catalogue has no masses; a printed part that is not filled is lighter.

Torsional friction is that of Hertz' pressure under Coulomb's law, torque = 3π/16 µ a F, with the contact radius a of a
press of 1 mm (or the deepest one of the fit).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from optopad.cad.mesh import Mesh, mesh_of
from optopad.cad.mold import build_mold
from optopad.design.arrays import FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.fields.packaged import data_quantities
from optopad.design.mold.outline import MoldOutline
from optopad.design.once import once
from optopad.design.parts.catalog import find_mold_material
from optopad.design.shape.cavity import Plan, edge_mm
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import elastomer_of, entries_of
from optopad.fabrication.scene.contact_fit import DESIGN, TOP, WEIGHT, contact_fit

M_PER_MM = 1e-3
KG_PER_MM3 = 1e-6
"""Of a density of 1 g/cm3."""
TAXEL_MM, MOST_TAXELS = 1.0, 1200
"""Distance between taxels along x and y [mm]; doubled, and doubled again, while there are more taxels than that."""
RINGS = 16
"""Rings of points on a crown, from the middle to the edge: facets are at most 0.02 mm below the fingertips' crown."""
WALL_TURN_RAD = math.pi / 8
"""Turn from one box of a round wall to the next."""
SEEN, TOUCHED, HIDDEN = 2, 3, 5
"""Groups of geoms: what is seen, collision, and what is neither; viewers draw the first three groups."""
CORE_SHARE = 0.4
"""Height of the core over that of the silicone [-]."""
MOLD_RGBA = (0.13, 0.13, 0.15, 1.0)
SILICONE_RGBA = (0.80, 0.88, 0.95, 0.55)


def pad_spec(design: SensorDesign) -> mujoco.MjSpec:
    """A design's pad as a MuJoCo specification, to attach to a robot's; call `contact_fit.tuned` once it is compiled.

    Raises
    ------
    DesignError : the design breaks a rule.
    ModelScopeError : the contact model does not cover the pad.
    """
    draft, fit = Draft.of(design), contact_fit(design)
    outline = draft.outline
    origin = _origin_mm(outline)
    spec = mujoco.MjSpec()
    spec.modelname = design.name
    spec.add_numeric(name=WEIGHT, data=[fit.inverse_weight])
    spec.add_text(name=DESIGN, data=design.digest)
    pad = spec.worldbody.add_body(name="pad")
    pad.add_site(name="pad_mount", size=[M_PER_MM] * 3, group=HIDDEN)
    pad.add_site(name="pad_cavity", pos=_m(-origin), size=[M_PER_MM] * 3, group=HIDDEN)
    masses = {"pad_mold": _mold(design)[1], "pad_silicone": _silicone(design)[1]}
    for (name, mesh), rgba in zip(pad_meshes(design).items(), (MOLD_RGBA, SILICONE_RGBA), strict=True):
        _add_mesh(spec, name, mesh.vertices, mesh.triangles)
        pad.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, mass=masses[name], rgba=rgba, group=SEEN,
            contype=0, conaffinity=0,
        )  # fmt: skip
    for name, block in _walls(outline):
        pad.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=_m(block.centre_mm - origin), size=_m(block.half_mm),
            quat=[math.cos(block.turn_rad / 2), 0.0, 0.0, math.sin(block.turn_rad / 2)], mass=0.0, group=TOUCHED,
        )  # fmt: skip
    face = pad.add_body(name="pad_face")
    friction = data_quantities("friction.toml")["dry"].value
    contact = {
        "mass": 0.0, "group": TOUCHED, "priority": 1, "condim": 4, "solref": fit.solref, "solimp": fit.solimp,
        "friction": [friction, 3.0 * math.pi / 16.0 * friction * fit.contact_radius_mm * M_PER_MM, 1e-4],
    }  # fmt: skip
    hard = {"mass": 0.0, "group": TOUCHED, "solref": fit.solref}
    _add_filling(spec, pad, "pad_core", outline, outline.bottom_mm, CORE_SHARE, hard)
    _add_filling(spec, face, TOP, outline, outline.cavity_bottom_mm, 1.0, contact)
    _add_taxels(spec, pad, design, origin)
    return spec


def taxels_mm(design: SensorDesign) -> FloatArray:
    """Points (n, 3) of the tactile sensor on the untouched top, in cavity coordinates [mm].

    They are a square grid about the middle of the pad, ordered by x, then by y. The sensor has n depths, then n speeds
    along x, then n along y.
    """
    plan, step = Draft.of(design).cavity.plan, TAXEL_MM
    while plan.area_mm2 / step**2 > MOST_TAXELS:
        step *= 2.0
    lines = [
        centre + step * np.arange(-(steps := int((high - centre) / step)), steps + 1)
        for centre, high in zip(plan.centre_mm, plan.outline.box_mm[2:], strict=True)
    ]
    x, y = (axis.ravel() for axis in np.meshgrid(*lines, indexing="ij"))
    inside = plan.outline.contains(x, y)
    return np.column_stack([x[inside], y[inside], plan.top.height_mm(x[inside], y[inside])])


def _add_filling(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    outline: MoldOutline,
    foot_mm: float,
    share: float,
    contact: dict[str, Any],
) -> None:
    """Add a geom that fills the pad's outline from a height to a share of the silicone's height."""
    plan, bottom, origin = outline.plan, outline.cavity_bottom_mm, _origin_mm(outline)
    if plan.is_block:
        box = _between(
            np.array([0.0, 0.0, foot_mm]),
            np.array([plan.length_mm, plan.width_mm, bottom + share * (plan.clear_mm - bottom)]),
        )
        kind = {"type": mujoco.mjtGeom.mjGEOM_BOX, "pos": _m(box.centre_mm - origin), "size": _m(box.half_mm)}
    else:
        layer = _layer(plan, bottom, foot_mm, share)
        _add_mesh(spec, name, layer.vertices - origin, layer.triangles)
        kind = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name}
    body.add_geom(name=name, **kind, **contact)


def _origin_mm(outline: MoldOutline) -> FloatArray:
    """Middle of the mold's underside in cavity coordinates [mm]."""
    return np.array([*outline.plan.centre_mm, outline.bottom_mm])


def _m(mm: FloatArray) -> list[float]:
    return [float(one) for one in np.round(mm * M_PER_MM, 9)]


def _add_mesh(
    spec: mujoco.MjSpec,
    name: str,
    vertices_mm: FloatArray | NDArray[np.float32],
    triangles: IntArray,
    normals: FloatArray | None = None,
) -> None:
    mesh = spec.add_mesh(name=name)
    mesh.uservert = (np.asarray(vertices_mm, np.float64) * M_PER_MM).ravel()
    mesh.userface = np.asarray(triangles).ravel()
    if normals is None:
        return
    mesh.usernormal = normals.ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def _add_taxels(spec: mujoco.MjSpec, pad: mujoco.MjsBody, design: SensorDesign, origin: FloatArray) -> None:
    points = taxels_mm(design)
    top = Draft.of(design).plan.top
    normal = top.normal(points[:, 0], points[:, 1])
    first = np.column_stack([normal[:, 2], np.zeros(len(points)), -normal[:, 0]])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frames = np.stack([normal, first, np.cross(normal, first)], axis=1)
    triangles = Delaunay(points[:, :2]).simplices
    _add_mesh(spec, "pad_taxels", points - origin, triangles, frames)
    pad.add_geom(
        name="pad_taxels", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="pad_taxels", mass=0.0, group=HIDDEN,
        rgba=[0.0, 0.0, 0.0, 0.0], contype=0, conaffinity=0,
    )  # fmt: skip
    spec.add_sensor(
        name="pad_tactile", type=mujoco.mjtSensor.mjSENS_TACTILE, objtype=mujoco.mjtObj.mjOBJ_MESH,
        objname="pad_taxels", reftype=mujoco.mjtObj.mjOBJ_GEOM, refname="pad_taxels",
    )  # fmt: skip


def pad_meshes(design: SensorDesign) -> dict[str, Mesh]:
    """Visual meshes by name, with their origin at the mount [mm]."""
    origin = _origin_mm(Draft.of(design).outline)
    return {
        name: Mesh(vertices=(mesh.vertices - origin).astype(np.float32), triangles=mesh.triangles)
        for name, (mesh, _) in (("pad_mold", _mold(design)), ("pad_silicone", _silicone(design)))
    }


@once
def _mold(design: SensorDesign) -> tuple[Mesh, float]:
    """Mesh of the mold in cavity coordinates, and its mass [kg]."""
    mesh = mesh_of(build_mold(design))
    density = find_mold_material(entries_of(design), design.mold.material).density_g_per_cm3.value
    a, b, c = mesh.corners.transpose(1, 0, 2)
    volume_mm3 = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6.0
    return mesh, volume_mm3 * density * KG_PER_MM3


def _silicone(design: SensorDesign) -> tuple[Mesh, float]:
    """Mesh of both layers of silicone in cavity coordinates, and their mass [kg]."""
    draft = Draft.of(design)
    plan, bottom = draft.cavity.plan, draft.outline.cavity_bottom_mm
    volume_mm3 = plan.clear_volume_mm3 - plan.area_mm2 * bottom
    return _layer(plan, bottom, bottom), volume_mm3 * elastomer_of(
        design
    ).density_g_per_cm3.value * KG_PER_MM3


def _layer(plan: Plan, bottom_mm: float, foot_mm: float, share: float = 1.0) -> Mesh:
    """The body from a foot to a share of the way from the silicone's bottom up to the untouched top.

    Points of its top are in rings from the middle to the edge.
    """
    edge, middle = edge_mm(plan)[:, :2], np.array(plan.centre_mm)
    shares = np.linspace(0.0, 1.0, 2 if plan.top.is_flat else RINGS)
    places = (middle + shares[1:, None, None] * (edge - middle)).reshape(-1, 2)
    top = np.column_stack([places, bottom_mm + share * (plan.top.height_mm(*places.T) - bottom_mm)])
    low = np.column_stack([edge, np.full(len(edge), foot_mm)])
    vertices = np.concatenate(
        [[[*middle, bottom_mm + share * (plan.clear_mm - bottom_mm)]], top, low, [[*middle, foot_mm]]]
    )
    count, spoke = len(edge), np.arange(len(edge))
    after = (spoke + 1) % count
    fans = [
        np.stack([np.zeros(count, int), 1 + spoke, 1 + after], axis=1),
        np.stack([np.full(count, len(vertices) - 1), 1 + len(top) + after, 1 + len(top) + spoke], axis=1),
    ]
    for ring in range(len(shares) - 1):
        a, b = 1 + ring * count + spoke, 1 + ring * count + after
        fans += [np.stack([a, a + count, b + count], axis=1), np.stack([a, b + count, b], axis=1)]
    return Mesh(vertices=vertices.astype(np.float32), triangles=np.concatenate(fans))


@dataclass(frozen=True, kw_only=True)
class _Block:
    """A box in cavity coordinates [mm], turned about z."""

    centre_mm: FloatArray
    half_mm: FloatArray
    turn_rad: float = 0.0


def _walls(outline: MoldOutline) -> list[tuple[str, _Block]]:
    """Boxes of the mold's walls and collars.

    A round wall is boxes around its inner face; at their joints they reach beyond the outer face by a fiftieth of its
    radius.
    """
    inside = outline.plan.outline.bare
    corners = inside.points(WALL_TURN_RAD)
    ways = np.roll(corners, -1, axis=0) - corners
    angles = np.arctan2(ways[:, 1], ways[:, 0])
    blocks = []
    for k, (corner, way, angle) in enumerate(zip(corners, ways, angles, strict=True)):
        across = np.array([math.sin(angle), -math.cos(angle)])
        middle = corner + way / 2
        thick = outline.wall_x_mm * across[0] ** 2 + outline.wall_y_mm * across[1] ** 2
        turns = (angle - angles[k - 1], angles[(k + 1) % len(angles)] - angle)
        bend = max((turn + math.pi) % (2.0 * math.pi) - math.pi for turn in turns)
        half = np.hypot(*way) / 2 + thick * math.tan(bend / 2)
        out = float(inside.gap_mm(*middle)) + thick / 2
        low, high = outline.bottom_mm, outline.top_mm
        blocks.append(
            _Block(
                centre_mm=np.array([*(middle + out * across), (low + high) / 2]),
                half_mm=np.array([half, thick / 2, (high - low) / 2]),
                turn_rad=float(angle),
            )
        )
    for collar in outline.collars:
        box = collar.box
        blocks.append(_between(np.array([box.x0, box.y0, box.z0]), np.array([box.x1, box.y1, box.z1])))
    return [(f"pad_wall_{k + 1}", block) for k, block in enumerate(blocks)]


def _between(low_mm: FloatArray, high_mm: FloatArray) -> _Block:
    """The box between two corners."""
    return _Block(centre_mm=(low_mm + high_mm) / 2, half_mm=(high_mm - low_mm) / 2)
