"""The forward walk written for Mitsuba 3: a vectorised drjit loop, compiled with LLVM, on a mesh of the top.

An outside check of the light engine and a measure of its speed. Mitsuba supplies the intersection with the triangles of
the top (embree), the interpolated normals and Fresnel's equations; drjit the loop, the random numbers and the compiler.
Walls and bottom are planes, written out. Nothing of `sims.optics` takes part but the scene's numbers. Optional: needs
`pip install mitsuba` and an LLVM library that drjit accepts (19 does, 15 aborts; DRJIT_LIBLLVM_PATH names it).

The walk: emitters by the cosine law; at the top Fresnel's share as weight; walls and bottom scatter by chance; a
receiver, the tip within the contact radius, or a face that does not scatter ends a ray; faint rays end by roulette.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from sims.optics.scene.optical_scene import OpticalScene
from tests.bench.measures.forward_walk import FAINT, KEPT, MOST_FLIGHTS, Walked
from tests.bench.measures.surface_mesh import GRID, top_mesh

mi.set_variant("llvm_ad_rgb")

FloatArray = NDArray[np.float64]

LANES = 1 << 20
"""Rays of one launch."""
NUDGE_MM = 1e-4
"""A ray restarts this far below the top [mm]; single precision carries 32 mm to 2e-6 mm."""


@dataclass(frozen=True, kw_only=True)
class Pad:
    """A pressed pad as Mitsuba sees it."""

    scene: OpticalScene
    world: Any
    centre_mm: FloatArray
    contact_radius_mm: float


def pad(
    scene: OpticalScene,
    centre_mm: FloatArray,
    height: Callable[[FloatArray], FloatArray],
    contact_radius_mm: float,
    grid: int = GRID,
) -> Pad:
    """A mesh of the top, 2 grid² triangles with normals from the slope of its height over radius [mm]."""
    vertices, triangles = top_mesh(scene, centre_mm, height, grid)
    offset = vertices[:, :2] - centre_mm
    radius = np.maximum(np.hypot(offset[:, 0], offset[:, 1]), 1e-6)
    step = 1e-5
    slope = (height(radius + step) - height(np.maximum(radius - step, 0.0))) / (2.0 * step)
    normals = np.column_stack([-slope[:, None] * offset / radius[:, None], np.ones(len(radius))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = mi.Mesh("top", len(vertices), len(triangles), has_vertex_normals=True)
    parts = mi.traverse(mesh)
    parts["vertex_positions"] = vertices.ravel().astype(np.float32)
    parts["vertex_normals"] = normals.ravel().astype(np.float32)
    parts["faces"] = triangles.ravel().astype(np.uint32)
    parts.update()
    world = mi.load_dict({"type": "scene", "top": mesh})
    return Pad(scene=scene, world=world, centre_mm=np.asarray(centre_mm), contact_radius_mm=contact_radius_mm)


def walk(given: Pad, rays: int, seed: int = 0, threads: int = 1) -> Walked:
    """Send at least `rays` rays from every emitter, in whole launches; the first launch is not timed (it compiles)."""
    dr.set_thread_count(threads)
    emitters, receivers = len(given.scene.emitter_wall), len(given.scene.receiver_wall)
    launches = -(-rays // LANES)
    total, square = np.zeros((2, emitters, receivers))
    segments, seconds = 0, 0.0
    for launch in range(-1, launches * emitters):
        emitter = max(launch, 0) % emitters
        start = process_time()
        parts = _launch(given, emitter, seed * 100_003 + launch + 1)
        if launch < 0:
            continue
        seconds += process_time() - start
        total[emitter] += parts[0]
        square[emitter] += parts[1]
        segments += int(parts[2])
    sent = launches * LANES
    mean = total / sent
    return Walked(
        flux=mean,
        variance=square / sent - mean**2,
        rays=sent,
        segments=segments,
        seconds=seconds,
    )


def _launch(given: Pad, emitter: int, seed: int) -> tuple[FloatArray, FloatArray, float]:
    """(r,) sums of weights and of their squares of one launch, and its flights."""
    count = len(given.scene.receiver_wall)
    total, square = dr.zeros(mi.Float, count), dr.zeros(mi.Float, count)
    flights = dr.zeros(mi.UInt32, 1)
    _follow(given, emitter, mi.PCG32(LANES, seed), total, square, flights)
    dr.eval(total, square, flights)
    return np.array(total, dtype=np.float64), np.array(square, dtype=np.float64), float(np.array(flights)[0])


def _cosine_direction(kind: Any, u: Any, v: Any) -> Any:
    """By the cosine law about the inward normal of a wall (0-3) or the bottom (4)."""
    sine = dr.sqrt(u)
    sin_v, cos_v = dr.sincos(dr.two_pi * v)
    a, b, c = sine * cos_v, sine * sin_v, dr.sqrt(dr.maximum(0.0, 1.0 - u))
    x = dr.select(kind == 1, -c, dr.select(kind == 3, c, a))
    y = dr.select(kind == 0, c, dr.select(kind == 2, -c, dr.select(kind == 4, b, a)))
    z = dr.select(kind == 4, c, b)
    return mi.Vector3f(x, y, z)


def _start(given: Pad, emitter: int, random: Any) -> tuple[Any, Any]:
    scene = given.scene
    wall = int(scene.emitter_wall[emitter])
    along, height, half_width, half_height = (float(v) for v in scene.emitter_patch[emitter])
    u = along + (2.0 * random.next_float32() - 1.0) * half_width
    z = height + (2.0 * random.next_float32() - 1.0) * half_height
    far = {0: 0.0, 1: scene.length_mm, 2: scene.width_mm, 3: 0.0}[wall]
    place = mi.Vector3f(u, far, z) if wall % 2 == 0 else mi.Vector3f(far, u, z)
    direction = _cosine_direction(mi.UInt32(wall), random.next_float32(), random.next_float32())
    return place, direction


def _receiver(scene: OpticalScene, kind: Any, place: Any) -> Any:
    """Receiver at a wall point, or the count of receivers."""
    along = dr.select((kind == 0) | (kind == 2), place.x, place.y)
    found = mi.UInt32(len(scene.receiver_wall))
    for k, (wall, patch) in enumerate(zip(scene.receiver_wall, scene.receiver_patch, strict=True)):
        inside = (kind == int(wall)) & (dr.abs(along - float(patch[0])) <= float(patch[2]))
        inside &= dr.abs(place.z - float(patch[1])) <= float(patch[3])
        found = dr.select(inside, k, found)
    return found


def _box_hit(scene: OpticalScene, place: Any, direction: Any) -> tuple[Any, Any]:
    """Distance to walls and bottom, and which."""
    big = mi.Float(1e30)
    tx = dr.select(direction.x > 0, scene.length_mm - place.x, -place.x) / direction.x
    ty = dr.select(direction.y > 0, scene.width_mm - place.y, -place.y) / direction.y
    tx = dr.select(direction.x == 0.0, big, dr.maximum(tx, 0.0))
    ty = dr.select(direction.y == 0.0, big, dr.maximum(ty, 0.0))
    tz = dr.select(direction.z < 0, dr.maximum(-place.z / direction.z, 0.0), big)
    t = dr.minimum(tx, dr.minimum(ty, tz))
    kind = dr.select(t == tx, dr.select(direction.x > 0, mi.UInt32(1), mi.UInt32(3)), mi.UInt32(4))
    kind = dr.select((t == ty) & (t != tx), dr.select(direction.y > 0, mi.UInt32(2), mi.UInt32(0)), kind)
    return t, kind


def _follow(given: Pad, emitter: int, random: Any, total: Any, square: Any, flights: Any) -> None:
    """One launch; sums are scattered into `total`, `square` and `flights`."""
    place, direction = _start(given, emitter, random)
    state = (place, direction, mi.Float(1.0), mi.UInt32(0), random, mi.Bool(True), total, square)
    state = dr.while_loop(state, lambda *now: now[5], lambda *now: _flight(given, *now))
    dr.scatter_add(flights, state[3], mi.UInt32(0))


def _flight(
    given: Pad,
    place: Any,
    direction: Any,
    weight: Any,
    count: Any,
    random: Any,
    active: Any,
    total: Any,
    square: Any,
) -> tuple[Any, ...]:
    """One flight of all rays, and what becomes of them where they land."""
    scene = given.scene
    t, kind = _box_hit(scene, place, direction)
    ray = mi.Ray3f(mi.Point3f(place), direction, t, 0.0, mi.Color0f())
    hit = given.world.ray_intersect_preliminary(ray, coherent=False, active=active)
    on_top = hit.is_valid() & (hit.t < t)
    surface = hit.compute_surface_interaction(ray, mi.RayFlags.ShadingFrame, on_top)
    normal = mi.Vector3f(surface.sh_frame.n)
    place = place + dr.select(on_top, hit.t, t) * direction
    cosine = dr.dot(direction, normal)
    off_x, off_y = place.x - float(given.centre_mm[0]), place.y - float(given.centre_mm[1])
    on_tip = on_top & (off_x * off_x + off_y * off_y < given.contact_radius_mm**2)
    found = _receiver(scene, kind, place)
    seen = active & ~on_top & (kind < 4) & (found < len(scene.receiver_wall))
    dr.scatter_add(total, weight, found, seen)
    dr.scatter_add(square, weight * weight, found, seen)
    chance = random.next_float32()
    share = dr.select(kind == 4, mi.Float(scene.bottom_reflectance), mi.Float(scene.wall_reflectance))
    ends = on_tip | (on_top & (cosine <= 0.0)) | (~on_top & (seen | (chance > share)))
    scattered = _cosine_direction(kind, random.next_float32(), random.next_float32())
    direction = dr.select(on_top, direction - 2.0 * cosine * normal, scattered)
    place = dr.select(on_top, place - NUDGE_MM * normal, place)
    reflected, _, _, _ = mi.fresnel(dr.maximum(cosine, 0.0), 1.0 / scene.refractive_index)
    weight = dr.select(on_top, weight * reflected, weight)
    faint = on_top & (weight < FAINT)
    ends |= faint & (chance > KEPT)
    weight = dr.select(faint, weight / KEPT, weight)
    count = count + 1
    return place, direction, weight, count, random, active & ~ends & (count < MOST_FLIGHTS), total, square
