# mypy: no-warn-return-any
"""Single light paths for pictures: random walks of rays through a pad, untouched or under one press.

A ray starts at a random point of an emitter's face, in a random direction of its pattern. The clear layer's top mirrors
it or lets it out by Fresnel's equations, by chance. Walls, bottom and tip scatter or absorb it, smooth walls mirror a
share. Receivers end it. A ray that leaves through the dimple flies on in air. It may enter the pad again, be mirrored
by the top, scattered by the tip or by an exposed wall, or escape over the walls. Absorption is left out, because a
picture shows where light goes, not its power.

The pad and its top are those of `optopad.sims.optics.engine.general`; a block has four flat walls there. Around the
press axis the top has one height for each radius, so the second height of a curve that folds is left out, as are the
few rays that the raised rim of a dimple mirrors upward. In air a ray is followed in steps of at least `AIR_STEP_MM`,
which may miss a shorter chord through that rim.

Every ray has a number, and its own stream of random numbers (splitmix64; Steele, Lea & Flood 2014). Under any press,
the ray of a number leaves its emitter at the same point in the same direction, so the effect of a press on one ray can
be followed.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.compiling import listen_to_numba
from optopad.sims.kernels import entry_points
from optopad.sims.optics.engine.general import rays, scattered, top
from optopad.sims.optics.engine.general.lower import formed_top, walls_of, windows_of
from optopad.sims.optics.engine.general.rays import (
    BOTTOM,
    INSIDE,
    NX,
    NY,
    NZ,
    ORDER,
    TABLE,
    TOP,
    inward,
    lobe,
    meeting,
    mirrored,
    onto,
    plan_exit,
    window_point,
)
from optopad.sims.optics.engine.general.scattered import about, face_before, window_at
from optopad.sims.optics.engine.general.top import (
    BARE,
    MIRRORING,
    OUTER,
    SKIN,
    FormedTop,
    above,
    into,
    is_contact,
    is_skirt,
    normal_at,
    out_of,
    sag,
    turn,
)
from optopad.sims.optics.scene.lower import block_form
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.optics.surface import curves, radial
from optopad.sims.optics.surface.curves import HIGHEST
from optopad.sims.optics.surface.radial import fresnel, kernel
from optopad.sims.press import Indentation

FATES = (
    "direct",
    "top",
    "skirt",
    "wall",
    "diffuse",
    "crossing",
    "walls",
    "bottom",
    "tip",
    "escaped",
    "uncounted",
    "skin",
)
"""Possible ends of light: the first six are classes of received light, the others are losses."""
(
    DIRECT,
    MIRRORED,
    SKIRT,
    WALL,
    DIFFUSE,
    CROSSING,
    WALLS,
    ON_BOTTOM,
    ON_TIP,
    ESCAPED,
    UNCOUNTED,
    ON_SKIN,
) = range(12)
LEFT_OUT = -1
"""End of a ray that would start above the top, or meets more than `PLACES` surfaces."""
TIP, AWAY = -4, -5
"""Codes of what a ray in air meets, besides those of `rays`."""
LOST = -1
"""Stands for a receiver's number where light reaches no receiver."""
PLACES = 200
"""Largest number of points on one path."""
NUDGE_MM = 1e-6
"""Distance of a ray's new start from the surface that it met [mm]."""
AIR_STEP_MM = 0.01
"""Shortest step of a ray in air [mm]."""


class Pad(NamedTuple):
    """The pad and the tip as kernels read them.

    Attributes
    ----------
    walls, arcs : flat and round walls (`optopad.sims.optics.engine.general.lower.walls_of`)
    emitters, receivers : their faces (`optopad.sims.optics.engine.general.lower.windows_of`)
    shares : (e, n) share of an emitter's power below each node of its table [-]
    reflectances : of walls, bottom and tip [-]
    refractive_index : of the elastomer [-]
    wall_ratio : that index divided by the index behind smooth walls [-]; 0 if walls only scatter
    skin : share of the light that a skin on the top mirrors or scatters [-]
    solid : the tip in press coordinates: height of its sphere's centre, and radius of the sphere (0 if none); radius of
        the cylinder above, and the height where that starts [mm]
    """

    walls: FloatArray
    arcs: FloatArray
    emitters: FloatArray
    receivers: FloatArray
    shares: FloatArray
    reflectances: tuple[float, float, float]
    refractive_index: float
    wall_ratio: float
    skin: float
    solid: tuple[float, float, float, float]


@kernel
def _scramble(key: np.uint64) -> np.uint64:
    """Mix 64 bits so that neighbouring keys give unrelated numbers (the final step of splitmix64)."""
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))


@kernel
def _ray_stream(seed: int, emitter: int, ray: int) -> np.uint64:
    """Initial state of one ray's random stream."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    key = _scramble(_scramble(np.uint64(seed) + golden) + golden)
    return _scramble((_scramble((key ^ np.uint64(emitter)) + golden) ^ np.uint64(ray)) + golden)


@kernel
def _draw(stream: np.uint64) -> tuple[np.uint64, float]:
    """Advance a stream; return its new state and a random number in [0, 1)."""
    stream = stream + np.uint64(0x9E3779B97F4A7C15)
    return stream, float(_scramble(stream) >> np.uint64(11)) * 2.0**-53


@kernel
def _table_cosine(radiance: FloatArray, shares: FloatArray, u: float) -> float:
    """Cosine below which an emitter radiates the share u of its power; the power is cubic between a table's nodes."""
    last = shares.shape[0] - 1
    goal = u * shares[last]
    cell = min(max(np.searchsorted(shares, goal, side="right") - 1, 0), last - 1)
    width = 1.0 / last
    start, low, step = (
        cell * width,
        radiance[TABLE + cell],
        radiance[TABLE + cell + 1] - radiance[TABLE + cell],
    )
    wanted = (goal - shares[cell]) / (2.0 * math.pi * width)
    left, right = 0.0, 1.0
    for _ in range(50):
        t = 0.5 * (left + right)
        if ((width * step / 3.0 * t + (start * step + width * low) / 2.0) * t + start * low) * t > wanted:
            right = t
        else:
            left = t
    return start + width * left


@kernel
def _refracted(
    dx: float, dy: float, dz: float, nx: float, ny: float, nz: float, ratio: float
) -> tuple[float, float, float]:
    """Unit direction behind a border that light passes (Snell's law).

    nx, ny, nz : unit normal that points to the far side
    ratio : index on the ray's side divided by the index behind the border [-]
    """
    cosine = dx * nx + dy * ny + dz * nz
    bend = math.sqrt(max(1.0 - ratio * ratio * (1.0 - cosine * cosine), 0.0)) - ratio * cosine
    ex, ey, ez = ratio * dx + bend * nx, ratio * dy + bend * ny, ratio * dz + bend * nz
    size = math.sqrt(ex * ex + ey * ey + ez * ez)
    return ex / size, ey / size, ez / size


@kernel
def _tip_gap(solid: tuple[float, float, float, float], x: float, y: float, z: float) -> float:
    """Distance of a point in press coordinates from the tip [mm]; negative inside."""
    middle, sphere, radius, foot = solid
    if z < foot and sphere > 0.0:
        return math.sqrt(x * x + y * y + (z - middle) * (z - middle)) - sphere
    return max(math.sqrt(x * x + y * y) - radius, foot - z)


@kernel
def _met_in_air(
    pad: Pad, top: FormedTop, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, int, float, float, float]:
    """What a ray in air meets: distance [mm], code, and the normal of top or tip there, out of it."""
    limit, what = plan_exit(x, y, z, dx, dy, dz, pad.walls, pad.arcs)
    ax, ay, az = into(top, x, y, z)
    bx, by, bz = turn(top, dx, dy, dz)
    before = t = 0.0
    while t < limit:
        px, py, pz = ax + t * bx, ay + t * by, az + t * bz
        gap = min(above(top, px, py, pz), _tip_gap(pad.solid, px, py, pz))
        if gap < 0.0:
            for _ in range(40):
                middle = 0.5 * (before + t)
                px, py, pz = ax + middle * bx, ay + middle * by, az + middle * bz
                if min(above(top, px, py, pz), _tip_gap(pad.solid, px, py, pz)) < 0.0:
                    t = middle
                else:
                    before = middle
            px, py, pz = ax + t * bx, ay + t * by, az + t * bz
            if is_contact(top, px, py) or _tip_gap(pad.solid, px, py, pz) < above(top, px, py, pz):
                middle, sphere, _, foot = pad.solid
                nz = pz - middle if sphere > 0.0 and pz < foot else 0.0
                per = 1.0 / max(math.sqrt(px * px + py * py + nz * nz), NUDGE_MM)
                nx, ny, nz = out_of(top, px * per, py * per, nz * per)
                return t, TIP, nx, ny, nz
            nx, ny, nz = normal_at(top, px, py)
            nx, ny, nz = out_of(top, nx, ny, nz)
            return t, TOP, nx, ny, nz
        if pz > top.row[HIGHEST] and bz >= 0.0 and px * bx + py * by >= 0.0:
            return t, AWAY, 0.0, 0.0, 0.0
        before = t
        t += max(0.5 * gap, AIR_STEP_MM)
    px, py, pz = ax + limit * bx, ay + limit * by, az + limit * bz
    if what == BOTTOM or pz + sag(top, px, py) > 0.0:  # over the walls
        return limit, AWAY, 0.0, 0.0, 0.0
    return limit, what, 0.0, 0.0, 0.0


@kernel
def _walk(
    pad: Pad, top: FormedTop, emitter: int, stream: np.uint64, places: FloatArray
) -> tuple[int, int, int]:
    """Follow one ray to its end, and put the points of its path into `places` (`PLACES`, 3).

    Returns
    -------
    index into `FATES`, or `LEFT_OUT`; number of the receiver, or `LOST`; number of points
    """
    walls, bottom, tip = pad.reflectances
    window = pad.emitters[emitter]
    stream, u = _draw(stream)
    stream, v = _draw(stream)
    x, y, z = window_point(window, 2.0 * u - 1.0, 2.0 * v - 1.0)
    px, py, pz = into(top, x, y, z)
    if above(top, px, py, pz) > 0.0:
        return LEFT_OUT, LOST, 0
    stream, u = _draw(stream)
    stream, v = _draw(stream)
    if window[ORDER] >= 0.0:
        cosine = (1.0 - u) ** (1.0 / (window[ORDER] + 1.0))
    else:
        cosine = _table_cosine(window, pad.shares[emitter], u)
    dx, dy, dz = about(-window[NX], -window[NY], -window[NZ], cosine, v)
    places[0, 0], places[0, 1], places[0, 2] = x, y, z
    path, in_air = DIRECT, False
    for count in range(1, PLACES):
        nx, ny, nz, receiver, scattered = 0.0, 0.0, 0.0, LOST, DIFFUSE
        if in_air:
            t, what, nx, ny, nz = _met_in_air(pad, top, x, y, z, dx, dy, dz)
            if what == AWAY:
                return ESCAPED, LOST, count
        else:
            t, what = meeting(x, y, z, dx, dy, dz, pad.walls, pad.arcs, top)
            t, receiver = face_before(x, y, z, dx, dy, dz, t, pad.receivers)
            what = what if receiver < 0 else INSIDE
        x, y, z = x + t * dx, y + t * dy, z + t * dz
        places[count, 0], places[count, 1], places[count, 2] = x, y, z
        stream, chance = _draw(stream)
        if what == TOP and not in_air:
            px, py, _ = into(top, x, y, z)
            nx, ny, nz = normal_at(top, px, py)
            nx, ny, nz = out_of(top, nx, ny, nz)
            if top.numbers[SKIN] != BARE:
                if chance >= pad.skin:
                    return ON_SKIN, LOST, count + 1
                if top.numbers[SKIN] == MIRRORING:
                    dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
                    path = max(path, SKIRT if is_skirt(top, px, py) else MIRRORED)
                    x, y, z = x - NUDGE_MM * nx, y - NUDGE_MM * ny, z - NUDGE_MM * nz
                    continue
                what, nx, ny, nz = TIP, -nx, -ny, -nz
                if path == DIRECT:  # scattered once, by the skin: light of the top
                    scattered = SKIRT if is_skirt(top, px, py) else MIRRORED
            elif is_contact(top, px, py):
                what, nx, ny, nz = TIP, -nx, -ny, -nz
        if what == TOP:
            side = -1.0 if in_air else 1.0
            nx, ny, nz = side * nx, side * ny, side * nz  # to the far side
            cosine = dx * nx + dy * ny + dz * nz
            ratio = 1.0 / pad.refractive_index if in_air else pad.refractive_index
            if cosine > 0.0 and chance < fresnel(cosine, ratio):
                dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
                if not in_air:
                    path = max(path, SKIRT if is_skirt(top, px, py) else MIRRORED)
                side = -NUDGE_MM
            elif cosine <= 0.0 and not in_air:  # grazes
                side = -NUDGE_MM
            else:
                if cosine > 0.0:
                    dx, dy, dz = _refracted(dx, dy, dz, nx, ny, nz, ratio)
                if top.numbers[OUTER] == 0.0:  # a convex pad is left for good
                    return ESCAPED, LOST, count + 1
                in_air, side = not in_air, NUDGE_MM
                path = path if in_air else CROSSING
            x, y, z = x + side * nx, y + side * ny, z + side * nz
            continue
        if what in (BOTTOM, INSIDE):
            receiver = window_at(what, x, y, z, pad.receivers) if what == BOTTOM and not in_air else receiver
            if receiver >= 0:
                if chance >= math.pi * lobe(
                    pad.receivers[receiver], onto(pad.receivers[receiver], dx, dy, dz)
                ):
                    return UNCOUNTED, LOST, count + 1
                return path, receiver, count + 1
        if what == TIP:
            if top.numbers[SKIN] == BARE and chance >= tip:
                return ON_TIP, LOST, count + 1
        elif what == BOTTOM:
            if chance >= bottom:
                return ON_BOTTOM, LOST, count + 1
            nz = 1.0
        else:
            nx, ny, nz = inward(what, x, y, pad.walls, pad.arcs)
            cosine = -(dx * nx + dy * ny + dz * nz)
            receiver = window_at(what, x, y, z, pad.receivers)
            if receiver >= 0 and not in_air:
                if chance >= math.pi * lobe(pad.receivers[receiver], cosine):
                    return UNCOUNTED, LOST, count + 1
                return path, receiver, count + 1
            share = fresnel(cosine, pad.wall_ratio) if pad.wall_ratio > 0.0 and not in_air else 0.0
            if chance < share:
                dx, dy, dz = mirrored(dx, dy, dz, nx, ny, nz)
                path = max(path, WALL)
                continue
            if receiver >= 0 or chance >= share + (1.0 - share) * walls:
                return WALLS, LOST, count + 1
        if what == TIP or in_air:
            x, y, z = x + NUDGE_MM * nx, y + NUDGE_MM * ny, z + NUDGE_MM * nz
        stream, u = _draw(stream)
        stream, v = _draw(stream)
        dx, dy, dz = about(nx, ny, nz, math.sqrt(1.0 - u), v)
        path = max(path, scattered)
    return LEFT_OUT, LOST, 0


@entry_points((curves, radial, top, rays, scattered, sys.modules[__name__]), error_model="numpy", nogil=True)
def next_path(
    pad: Pad, top: FormedTop, emitter: int, wanted: BoolArray, seed: int, ray: int, tries: int
) -> tuple[int, int, int, FloatArray]:
    """Follow rays from number `ray` on until one ends as requested: its number, fate (-1: none), receiver, points."""
    places = np.empty((PLACES, 3))
    for number in range(ray, ray + tries):
        fate, receiver, count = _walk(pad, top, emitter, _ray_stream(seed, emitter, number), places)
        if fate != LEFT_OUT and wanted[receiver]:  # LOST is the last
            return number, fate, receiver, places[:count].copy()
    return ray + tries, -1, LOST, places[:0].copy()


listen_to_numba()


@dataclass(frozen=True, kw_only=True)
class LightPath:
    """One ray from its emitter to its end.

    Attributes
    ----------
    fate : how the ray ends: name of its class of light if it reaches a receiver, else name of the loss (`FATES`)
    emitter, receiver : numbers of both; the receiver is `LOST` if the light is lost
    ray : number of the ray
    places_mm : (n, 3) points along the path [mm]; one that escapes ends at its last interaction
    """

    fate: str
    emitter: int
    receiver: int
    ray: int
    places_mm: FloatArray


class LightWalker:
    """The pad under a press, ready to follow single rays.

    Parameters
    ----------
    scene : the pad
    centre_mm : (2,) press axis [mm]
    press : the press, None for the untouched pad
    seed : seed of the random streams, 0 to 2^63 - 1
    """

    def __init__(
        self, scene: OpticalScene, centre_mm: ArrayLike, press: Indentation | None, seed: int
    ) -> None:
        self._pad = _pad_of(scene, press)
        self._top = formed_top(_formed(scene), np.asarray(centre_mm, dtype=np.float64), press)
        self._seed = seed

    def random_paths(
        self, emitter: int, ends: Sequence[int] | None = None, *, count: int, most_rays: int
    ) -> list[LightPath]:
        """Random paths of one emitter's light, with probabilities proportional to their power, sorted by ray number.

        Parameters
        ----------
        emitter : number of the emitter
        ends : numbers of the receivers that count, and `LOST` if light that reaches no receiver counts; if None, every
            end counts
        count : requested paths
        most_rays : largest number of rays tried; if these are not enough, fewer paths than `count` are returned
        """
        wanted = np.full(len(self._pad.receivers) + 1, ends is None)
        wanted[list(ends or ())] = True
        paths: list[LightPath] = []
        ray = 0
        while len(paths) < count and (path := self._next(emitter, ray, most_rays - ray, wanted)) is not None:
            paths.append(path)
            ray = path.ray + 1
        return paths

    def follow(self, emitter: int, numbers: Sequence[int]) -> list[LightPath]:
        """Paths of the rays with given numbers; a ray that starts above the surface is left out.

        Parameters
        ----------
        emitter : number of the emitter
        numbers : numbers as in `LightPath.ray`, from any press with the same seed
        """
        anywhere = np.ones(len(self._pad.receivers) + 1, dtype=np.bool_)
        found = (self._next(emitter, ray, 1, anywhere) for ray in numbers)
        return [path for path in found if path is not None]

    def _next(self, emitter: int, ray: int, tries: int, wanted: BoolArray) -> LightPath | None:
        number, fate, receiver, places = next_path(
            self._pad, self._top, emitter, wanted, self._seed, ray, tries
        )
        if fate < 0:
            return None
        return LightPath(fate=FATES[fate], emitter=emitter, receiver=receiver, ray=number, places_mm=places)


def _pad_of(scene: OpticalScene, press: Indentation | None) -> Pad:
    formed = _formed(scene)
    walls, arcs = walls_of(formed)
    emitters = windows_of(formed, "emitter")
    return Pad(
        walls=walls,
        arcs=arcs,
        emitters=emitters,
        receivers=windows_of(formed, "receiver"),
        shares=_shares(emitters[:, TABLE:]),
        reflectances=(
            float(scene.wall_reflectance),
            float(scene.bottom_reflectance),
            float(scene.tip_reflectance),
        ),
        refractive_index=float(scene.refractive_index),
        wall_ratio=0.0 if scene.wall_index is None else float(scene.refractive_index / scene.wall_index),
        skin=float(scene.top_reflectance),
        solid=_solid(press),
    )


def _formed(scene: OpticalScene) -> OpticalScene:
    return scene if scene.form is not None else replace(scene, form=block_form(scene))


def _shares(radiance: FloatArray) -> FloatArray:
    """(e, n) share of power below each node of radiance tables (e, n) over the cosine [-]: 2 π ∫ c L dc from 0."""
    shares = np.zeros_like(radiance)
    if radiance.shape[1]:
        cosine, width = np.linspace(0.0, 1.0, radiance.shape[1]), 1.0 / (radiance.shape[1] - 1)
        low, step = radiance[:, :-1], np.diff(radiance, axis=1)
        parts = cosine[:-1] * (low + step / 2.0) + width * (low / 2.0 + step / 3.0)
        shares[:, 1:] = 2.0 * math.pi * width * np.cumsum(parts, axis=1)
    return shares


def _solid(press: Indentation | None) -> tuple[float, float, float, float]:
    """`Pad.solid` of a press: a hemisphere with a shank, or a cylinder that starts where the contact ends."""
    if press is None:
        return 0.0, 0.0, 0.0, math.inf
    tip, middle = float(press.tip_radius_mm), float(press.tip_radius_mm - press.depth_mm)
    if press.is_hemisphere:
        return middle, tip, tip, middle
    edge = np.flatnonzero(np.asarray(press.radius_mm) <= press.contact_radius_mm * (1.0 + 1e-9))[-1]
    return 0.0, 0.0, float(press.contact_radius_mm), float(press.height_mm[edge])
