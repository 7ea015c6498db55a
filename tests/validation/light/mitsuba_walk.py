"""The forward walk written for Mitsuba 3: a vectorised drjit loop, compiled with LLVM, on a mesh of the top.

An outside check of the light engine and a measure of its speed. Mitsuba supplies the intersection with the triangles of
the top (embree), the interpolated normals and Fresnel's equations; drjit the loop, the random numbers and the compiler.
Flat walls, a round wall, the bottom and faces on the floor are written out. Nothing of `optopad.sims.optics` takes part
but the scene's numbers. Optional: needs `pip install mitsuba` and an LLVM library that drjit accepts (19 does, 15
aborts; DRJIT_LIBLLVM_PATH names it).

The walk: emitters radiate by their order or table; at the top Fresnel's share becomes weight, and absorption on every
flight; walls, bottom and tip scatter by chance; a receiver, or a face that does not scatter, ends a ray; faint rays end
by roulette. A receiver counts the share that its response table gives for the angle of arrival. A skin has a fixed
reflectance: it mirrors like the bare top, or scatters by chance. Light that a skin alone has scattered counts as
mirrored, as in the engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.spatial.transform import Rotation

from optopad.design.arrays import FloatArray
from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm
from tests.bench.measures.forward_walk import FAINT, KEPT, MOST_FLIGHTS
from tests.bench.measures.surface_mesh import TopMesh, form_of

mi.set_variant("llvm_ad_rgb")


LANES = 1 << 20
"""Rays of one launch."""
EVEN = tuple(round(2**32 / 1.1673039782614187**power) for power in range(1, 5))
"""Steps of an evenly spread sequence in four dimensions, over 2^32: powers of the root of x^5 = x + 1."""
NUDGE_MM = 1e-4
"""A ray restarts this far below the top [mm]; single precision carries 32 mm to 2e-6 mm."""
COSINES = 8192
"""Entries of an emitter's table of cosines over the root of the share of its power."""
DIRECT, MIRRORED, DIFFUSE = range(3)


@dataclass(frozen=True, kw_only=True)
class Counted:
    """What the walk counted, by launch, class (direct, mirrored by the top alone, diffuse), emitter and receiver.

    Attributes
    ----------
    flux : (launch, 3, e, r) share of the emitted power [-]
    square : (e, r) mean square of one ray's share [-]
    rays : of each emitter
    segments : flights of all rays
    seconds : processor time
    """

    flux: FloatArray
    square: FloatArray
    rays: int
    segments: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Face:
    """The face of a part on the floor.

    Attributes
    ----------
    centre : (3,) [mm]
    normal, width, height : (3,) unit vectors: into the elastomer, and along the sides [-]
    half_mm : half width, half height
    """

    centre: FloatArray
    normal: FloatArray
    width: FloatArray
    height: FloatArray
    half_mm: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Pad:
    """A pressed pad as Mitsuba sees it: the first `touched` triangles belong to the tip."""

    scene: OpticalScene
    form: PadForm
    world: Any
    touched: int
    cosines: Any
    response: Any
    emitter_faces: list[Face | None]
    receiver_faces: list[Face | None]

    @property
    def round_face(self) -> int:
        """Number of round walls as a face; flat walls come before, the bottom and the faces on the floor after it."""
        return len(self.form.walls)


def pad(scene: OpticalScene, top: TopMesh) -> Pad:
    """A scene under a mesh of its top.

    Raises
    ------
    ValueError : smooth walls, which this walk does not know
    """
    if scene.wall_index is not None:
        raise ValueError(f"wall_index: {scene.wall_index:g}, but the walk knows scattering walls only")
    mesh = mi.Mesh("top", len(top.vertices), len(top.triangles), has_vertex_normals=True)
    parts = mi.traverse(mesh)
    parts["vertex_positions"] = top.vertices.ravel()
    parts["vertex_normals"] = top.normals.ravel()
    parts["faces"] = top.triangles.ravel()
    parts.update()
    response = scene.receiver_response
    return Pad(
        scene=scene,
        form=form_of(scene),
        world=mi.load_dict({"type": "scene", "top": mesh}),
        touched=top.touched,
        cosines=[mi.Float(emitted_cosines(scene, k)) for k in range(len(scene.emitter_wall))],
        response=None if response is None else mi.Float(response.ravel()),
        emitter_faces=floor_faces(scene.emitter_pose, scene.emitter_patch),
        receiver_faces=floor_faces(scene.receiver_pose, scene.receiver_patch),
    )


def floor_faces(poses: FloatArray | None, patches: FloatArray) -> list[Face | None]:
    """Faces on the floor, by rotations of a face that looks up; None for a part on a wall."""
    found: list[Face | None] = [None] * len(patches)
    for k, pose in enumerate(() if poses is None else poses):
        if np.isnan(pose).any():
            continue
        turned = Rotation.from_euler("yz", pose[3:])
        normal, width, height = turned.apply([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
        half_mm = float(patches[k, 2]), float(patches[k, 3])
        found[k] = Face(centre=pose[:3], normal=normal, width=width, height=height, half_mm=half_mm)
    return found


def emitted_cosines(scene: OpticalScene, emitter: int) -> FloatArray:
    """(COSINES,) cosine below which a share p of an emitter's power lies, at evenly spaced √p [-]."""
    root = np.linspace(0.0, 1.0, COSINES)
    table = None if scene.emitter_pattern is None else scene.emitter_pattern[emitter]
    if table is None or np.isnan(table).all():
        return root ** (2.0 / (scene.emitter_order[emitter] + 1.0))
    cosine = np.linspace(0.0, 1.0, 16 * (len(table) - 1) + 1)
    density = cosine * np.interp(cosine, np.linspace(0.0, 1.0, len(table)), table)
    middle = 0.5 * (cosine[1:] + cosine[:-1])
    between = middle * np.interp(middle, np.linspace(0.0, 1.0, len(table)), table)
    power = np.append(0.0, np.cumsum(density[:-1] + 4.0 * between + density[1:]))
    rising = np.append(True, np.diff(power) > 0.0)
    return np.interp(root, np.sqrt(power[rising] / power[-1]), cosine[rising])


def walk(given: Pad, rays: int, seed: int = 0, *, is_even: bool = True, threads: int = 1) -> Counted:
    """Send at least `rays` rays from every emitter, in whole launches; the first launch is not timed (it compiles).

    is_even : places and directions of a launch are spread evenly, and moved by chance as a whole: launches then differ
        much less than by chance, and still tell how well their mean is known
    """
    dr.set_thread_count(threads)
    emitters, receivers = len(given.scene.emitter_wall), len(given.scene.receiver_wall)
    launches = -(-rays // LANES)
    total, square = np.zeros((launches, emitters, 3 * receivers)), np.zeros((emitters, receivers))
    segments, seconds = 0, 0.0
    for number in range(-1, launches * emitters):
        launch, emitter = divmod(max(number, 0), emitters)
        start = process_time()
        parts = _launch(given, emitter, seed * 100_003 + number + 1, is_even)
        if number < 0:
            continue
        seconds += process_time() - start
        total[launch, emitter] = parts[0]
        square[emitter] += parts[1]
        segments += int(parts[2])
    return Counted(
        flux=np.moveaxis(total.reshape(launches, emitters, 3, receivers) / LANES, 2, 1),
        square=square / (launches * LANES),
        rays=launches * LANES,
        segments=segments,
        seconds=seconds,
    )


def _launch(given: Pad, emitter: int, seed: int, is_even: bool) -> tuple[FloatArray, FloatArray, float]:
    """(3 r,) sums of weights of one launch by class and receiver, (r,) sums of their squares, and its flights."""
    receivers = len(given.scene.receiver_wall)
    total, square = dr.zeros(mi.Float, 3 * receivers), dr.zeros(mi.Float, receivers)
    flights = dr.zeros(mi.UInt32, 1)
    random = mi.PCG32(LANES, dr.opaque(mi.UInt64, seed))  # a plain number would compile every launch anew
    if is_even:
        moved = np.random.default_rng(seed).integers(0, 2**32, len(EVEN))
        lane = dr.arange(mi.UInt32, LANES)
        spread = [lane * step + dr.opaque(mi.UInt32, int(by)) for step, by in zip(EVEN, moved, strict=True)]
        chosen = [(mi.Float(one >> 8) + 0.5) * 2.0**-24 for one in spread]
    else:
        chosen = [random.next_float32() for _ in EVEN]
    place, direction, is_lit = _start(given, emitter, chosen)
    state = (place, direction, mi.Float(1.0), mi.UInt32(DIRECT), mi.UInt32(0), random, is_lit, total, square)
    state = dr.while_loop(state, lambda *now: now[6], lambda *now: _flight(given, *now))
    dr.scatter_add(flights, state[4], mi.UInt32(0))
    dr.eval(total, square, flights)
    return np.array(total, dtype=np.float64), np.array(square, dtype=np.float64), float(np.array(flights)[0])


def _about(normal: Any, cosine: Any, v: Any) -> Any:
    """The direction at a cosine to a unit normal and at the azimuth 2 π v."""
    sine = dr.sqrt(dr.maximum(0.0, 1.0 - cosine * cosine))
    sin_v, cos_v = dr.sincos(dr.two_pi * v)
    return mi.Frame3f(normal).to_world(mi.Vector3f(sine * cos_v, sine * sin_v, cosine))


def _looked_up(table: Any, first: Any, count: int, share: Any) -> Any:
    """Value of a table of `count` entries from `first` on, linear between them; share from 0 to 1."""
    at = dr.clip(share, 0.0, 1.0) * (count - 1)
    cell = dr.minimum(mi.UInt32(at), count - 2)
    low, high = (dr.gather(mi.Float, table, first + cell + step) for step in (0, 1))
    return low + (at - mi.Float(cell)) * (high - low)


def _untouched_top(given: Pad, place: Any) -> Any:
    """Height of the untouched top."""
    top, height = given.form.top, given.scene.height_mm
    if top.is_flat:
        return height
    x = 0.0 if top.straight == "x" else place.x - top.apex_mm[0]
    y = 0.0 if top.straight == "y" else place.y - top.apex_mm[1]
    fall = x * x + y * y
    return height - fall / (top.radius_mm + dr.sqrt(dr.maximum(top.radius_mm**2 - fall, 0.0)))


def _start(given: Pad, emitter: int, chosen: list[Any]) -> tuple[Any, Any, Any]:
    """Place and direction of rays of an emitter by four numbers in 0..1, and whether they start in the elastomer."""
    scene, on_floor = given.scene, given.emitter_faces[emitter]
    cosine = _looked_up(given.cosines[emitter], mi.UInt32(0), COSINES, dr.sqrt(chosen[2]))
    if on_floor is not None:
        a, b = ((2.0 * one - 1.0) * half for one, half in zip(chosen, on_floor.half_mm, strict=False))
        place = _vector(on_floor.centre) + a * _vector(on_floor.width) + b * _vector(on_floor.height)
        is_lit = (place.z >= -NUDGE_MM) & (place.z <= _untouched_top(given, place))
        return place, _about(_vector(on_floor.normal), cosine, chosen[3]), is_lit
    x, y, tx, ty, nx, ny = (float(v) for v in given.form.walls[scene.emitter_wall[emitter]])
    along, height, half_width, half_height = (float(v) for v in scene.emitter_patch[emitter])
    u = along + (2.0 * chosen[0] - 1.0) * half_width
    z = height + (2.0 * chosen[1] - 1.0) * half_height
    place = mi.Vector3f(x + u * tx, y + u * ty, z)
    direction = _about(mi.Vector3f(-nx, -ny, 0.0), cosine, chosen[3])
    return place, direction, place.z <= _untouched_top(given, place)


def _receiver(given: Pad, face: Any, place: Any) -> Any:
    """Receiver at a place on a face, or the count of receivers."""
    scene = given.scene
    found = mi.UInt32(len(scene.receiver_wall))
    for k, (wall, patch) in enumerate(zip(scene.receiver_wall, scene.receiver_patch, strict=True)):
        if given.receiver_faces[k] is not None:
            found = dr.select(face == given.round_face + 2 + k, k, found)
            continue
        x, y, tx, ty = (float(v) for v in given.form.walls[wall, :4])
        along = tx * (place.x - x) + ty * (place.y - y)
        inside = (face == int(wall)) & (dr.abs(along - float(patch[0])) <= float(patch[2]))
        inside &= dr.abs(place.z - float(patch[1])) <= float(patch[3])
        found = dr.select(inside, k, found)
    return dr.select(place.z <= _untouched_top(given, place), found, len(scene.receiver_wall))


def _face_hit(given: Pad, place: Any, direction: Any) -> tuple[Any, Any, Any]:
    """Distance to the first of walls, bottom and fronts of faces, which, and its unit normal into the elastomer.

    A face that is flush with the bottom is met in its place.
    """
    big = mi.Float(1e30)
    t = dr.select(direction.z < 0, dr.maximum(-place.z / direction.z, 0.0), big)
    face = mi.UInt32(given.round_face + 1)
    nx, ny = mi.Float(0.0), mi.Float(0.0)
    for k, wall in enumerate(given.form.walls):
        x, y, _, _, ox, oy = (float(v) for v in wall)
        toward = ox * direction.x + oy * direction.y
        gap = ox * (x - place.x) + oy * (y - place.y)
        at = dr.select(toward > 0, dr.maximum(gap, 0.0) / toward, big)
        nx, ny = dr.select(at < t, -ox, nx), dr.select(at < t, -oy, ny)
        face, t = dr.select(at < t, k, face), dr.minimum(at, t)
    for arc in given.form.arcs:
        cx, cy, radius, ux, uy, cosine = (float(v) for v in arc)
        px, py = place.x - cx, place.y - cy
        a, b = direction.x**2 + direction.y**2, px * direction.x + py * direction.y
        c = px * px + py * py - radius * radius
        gap = b * b - a * c
        root = dr.sqrt(dr.maximum(gap, 0.0))
        at = dr.maximum(
            dr.select((b > 0) & (gap > 0), -c / (b + root), (root - b) / dr.maximum(a, 1e-12)), 0.0
        )
        sector = (px + at * direction.x) * ux + (py + at * direction.y) * uy
        is_round = (at < t) & (sector >= cosine * radius)
        nx = dr.select(is_round, -(px + at * direction.x) / radius, nx)
        ny = dr.select(is_round, -(py + at * direction.y) / radius, ny)
        face, t = dr.select(is_round, given.round_face, face), dr.select(is_round, at, t)
    normal = dr.normalize(mi.Vector3f(nx, ny, dr.select(face == given.round_face + 1, 1.0, 0.0)))
    for k, one in enumerate([*given.receiver_faces, *given.emitter_faces]):
        if one is None:
            continue
        from_centre, own = place - _vector(one.centre), _vector(one.normal)
        toward = dr.dot(direction, own)
        at = -dr.dot(from_centre, own) / toward
        there = from_centre + at * direction
        is_met = (toward < 0) & (at >= 0) & (at <= t)
        is_met &= dr.abs(dr.dot(there, _vector(one.width))) <= one.half_mm[0]
        is_met &= dr.abs(dr.dot(there, _vector(one.height))) <= one.half_mm[1]
        face = dr.select(is_met, given.round_face + 2 + k, face)
        t, normal = dr.select(is_met, at, t), dr.select(is_met, own, normal)
    return t, face, normal


def _vector(values: FloatArray) -> Any:
    return mi.Vector3f(*(float(value) for value in values))


def _flight(
    given: Pad,
    place: Any,
    direction: Any,
    weight: Any,
    group: Any,
    count: Any,
    random: Any,
    active: Any,
    total: Any,
    square: Any,
) -> tuple[Any, ...]:
    """One flight of all rays, and what becomes of them where they land."""
    scene, receivers = given.scene, len(given.scene.receiver_wall)
    t, face, inward = _face_hit(given, place, direction)
    ray = mi.Ray3f(mi.Point3f(place), direction, t, 0.0, mi.Color0f())
    hit = given.world.ray_intersect_preliminary(ray, coherent=False, active=active)
    on_top = hit.is_valid() & (hit.t < t)
    surface = hit.compute_surface_interaction(ray, mi.RayFlags.ShadingFrame, on_top)
    normal = mi.Vector3f(surface.sh_frame.n)
    on_tip = on_top & (hit.prim_index < given.touched)  # or on a skin that scatters
    if scene.top_finish != "bare":
        on_tip = on_top & (scene.top_finish == "diffuse")
    is_free = on_top & ~on_tip
    distance = dr.select(on_top, hit.t, t)
    place = place + distance * direction
    weight *= dr.exp(-scene.absorption_per_mm * distance)
    cosine = dr.dot(direction, normal)
    found = _receiver(given, face, place)
    seen = active & ~on_top & (found < receivers)
    counted = mi.Float(weight)
    if scene.receiver_response is not None:
        nodes = scene.receiver_response.shape[1]
        first = dr.select(seen, found, 0) * nodes
        counted *= _looked_up(given.response, first, nodes, -dr.dot(direction, inward))
    dr.scatter_add(total, counted, group * receivers + found, seen)
    dr.scatter_add(square, counted * counted, found, seen)
    chance = random.next_float32()
    share = dr.select(
        face >= given.round_face + 1, scene.bottom_reflectance, mi.Float(scene.wall_reflectance)
    )
    is_bare = scene.top_finish == "bare"
    share = dr.select(on_tip, scene.tip_reflectance if is_bare else scene.top_reflectance, share)
    ends = seen | (on_top & (cosine <= 0.0)) | (~is_free & (chance >= share))
    lobe = dr.sqrt(1.0 - random.next_float32())
    scattered = _about(dr.select(on_tip, -normal, inward), lobe, random.next_float32())
    direction = dr.select(is_free, direction - 2.0 * cosine * normal, scattered)
    place = dr.select(on_top, place - NUDGE_MM * normal, place)
    reflected, _, _, _ = mi.fresnel(dr.maximum(cosine, 0.0), 1.0 / scene.refractive_index)
    if not is_bare:
        reflected = mi.Float(scene.top_reflectance)
    weight = dr.select(is_free, weight * reflected, weight)
    is_mirrored = is_free if is_bare else on_top
    group = dr.maximum(group, dr.select(is_mirrored, mi.UInt32(MIRRORED), mi.UInt32(DIFFUSE)))
    faint = is_free & (weight < FAINT)
    ends |= faint & (chance >= KEPT)
    weight = dr.select(faint, weight / KEPT, weight)
    count = count + 1
    active = active & ~ends & (count < MOST_FLIGHTS)
    return place, direction, weight, group, count, random, active, total, square
