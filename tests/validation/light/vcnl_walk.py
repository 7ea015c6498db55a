"""Light of one chip in the floor of a clear block, by a random walk of its own (`tests.validation.light.vcnl_table`).

The walk shares no code with the engine. A box of clear silicone stands on a board, which scatters its share of the
light to all sides; the top reflects by Fresnel's equations for unpolarised light. The sides scatter as the board does
with a share of their own, or they are bare and reflect as the top. A white cover lies wet on the top (it scatters its
share inside the silicone), or over a thin gap of air. The emitter's and the receiver's faces lie in the floor; the
emitter's scatters as the floor does, the receiver's absorbs what arrives.

Every scattering adds the light that goes from it to a random point of the receiver's face, straight or by way of the
top (next-event estimation), so nearly every ray counts. Bare sides multiply the receiver by its mirror images, up to
`IMAGES` reflections along x and along y: one random image stands for all of them. Light goes back and forth between
cover and top without moving sideways: the gap is thin.

The walk leaves out the chip's body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from optopad.design.arrays import FloatArray

LAST_WEIGHT, LAST_BOUNCE = 1e-4, 400
IMAGES, ORDERS = 3, 8
_ALL = [(i, j) for i in range(-IMAGES, IMAGES + 1) for j in range(-IMAGES, IMAGES + 1) if (i, j) != (0, 0)]
Angular = Callable[[FloatArray], FloatArray]
"""Values by the cosine of the angle to a face's normal."""


@dataclass(frozen=True, kw_only=True)
class Block:
    """A clear block over one chip; x and y from its corner, z from its floor [mm].

    Attributes
    ----------
    size : length, width and height of the block
    index : of the block; 1 for a chip in air, under a cover that is `wet`
    absorption : of the block [1/mm]
    cover : "bare", "wet" (a white layer on the top) or "gap" (a white plane over a thin gap of air)
    floor, white : shares of the light that floor and cover scatter [-]
    wall : share that the sides scatter [-]; None for bare sides
    emitter, receiver : x, y of the faces' centres
    emitter_width, receiver_width : of the square faces
    """

    size: tuple[float, float, float]
    index: float
    absorption: float = 0.0
    cover: str = "bare"
    floor: float = 0.0
    wall: float | None = 0.0
    white: float = 0.0
    emitter: tuple[float, float]
    receiver: tuple[float, float]
    emitter_width: float
    receiver_width: float

    def with_(self, **changes: object) -> Block:
        """The same block with other values."""
        return replace(self, **changes)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class Pattern:
    """Intensity of an emitter by its angle, from a table: linear in between, scaled to a power of 1.

    Attributes
    ----------
    angle : (n,) from 0 to pi / 2 [rad]
    intensity : (n,) power per solid angle [1/sr]
    """

    angle: FloatArray
    intensity: FloatArray

    @classmethod
    def of_table(cls, angle_deg: FloatArray, relative: FloatArray) -> Pattern:
        """Pattern of a data sheet's table."""
        angle = np.linspace(0.0, np.pi / 2, 4001)
        shape = np.interp(np.degrees(angle), angle_deg, relative)
        return cls(angle=angle, intensity=shape / (2.0 * np.pi * np.trapezoid(shape * np.sin(angle), angle)))

    @classmethod
    def of_half_angle(cls, half_angle_deg: float) -> Pattern:
        """Pattern that is a power of the cosine, half as strong at an angle."""
        order = np.log(0.5) / np.log(np.cos(np.radians(half_angle_deg)))
        angle = np.linspace(0.0, np.pi / 2, 4001)
        return cls.of_table(np.degrees(angle), np.cos(angle) ** order)

    def at(self, cosine: FloatArray) -> FloatArray:
        """(...,) intensity at a cosine [1/sr]."""
        return np.interp(np.arccos(np.clip(cosine, -1.0, 1.0)), self.angle, self.intensity)

    def drawn(self, chance: FloatArray) -> FloatArray:
        """(n,) cosines of random directions."""
        power = self.intensity * np.sin(self.angle)
        steps = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2)])
        return np.cos(np.interp(chance, steps / steps[-1], self.angle))


def fresnel(cosine: FloatArray, index_from: float, index_to: float) -> FloatArray:
    """(n,) unpolarised reflectance at a flat face (Hecht, Optics, eqs 4.34 and 4.40); 1 in total reflection."""
    sine = index_from / index_to * np.sqrt(1.0 - cosine**2)
    total = sine >= 1.0
    beyond = np.sqrt(1.0 - np.where(total, 0.0, sine) ** 2)
    s = (index_from * cosine - index_to * beyond) / (index_from * cosine + index_to * beyond)
    p = (index_to * cosine - index_from * beyond) / (index_to * cosine + index_from * beyond)
    return np.where(total, 1.0, (s * s + p * p) / 2)


def outside_reflectance(index: float) -> float:
    """Share of Lambertian light in air that a flat face of a denser medium reflects [-]."""
    angle = np.linspace(0.0, np.pi / 2, 4001)
    return float(
        np.trapezoid(2.0 * fresnel(np.cos(angle), 1.0, index) * np.cos(angle) * np.sin(angle), angle)
    )


def received(
    block: Block, pattern: Pattern, response: Angular, rays: int, seed: int
) -> tuple[float, float, FloatArray]:
    """Share of the emitter's light that the receiver counts, its standard error, and the share by scatterings.

    Parameters
    ----------
    response : counted share of the light that arrives at a cosine

    Returns
    -------
    share, standard error [-], (ORDERS,) share that arrives after 0, 1, ... scatterings, the last one: or more
    """
    walk = _Walk(block, response, np.random.default_rng(seed), rays)
    random = walk.random
    turn, cosine = 2.0 * np.pi * random.random(rays), pattern.drawn(random.random(rays))
    sine = np.sqrt(1.0 - cosine**2)
    walk.place[:, :2] = np.array(block.emitter) + (random.random((rays, 2)) - 0.5) * block.emitter_width
    walk.way = np.column_stack([sine * np.cos(turn), sine * np.sin(turn), cosine])
    walk.mirrored(np.arange(rays), pattern.at)
    for _ in range(LAST_BOUNCE):
        if not len(walk.alive):
            break
        walk.step()
    mean = walk.counted.mean()
    return float(mean), float(walk.counted.std() / np.sqrt(rays)), walk.by_order / rays


def _lambertian(cosine: FloatArray) -> FloatArray:
    return np.maximum(cosine, 0.0) / np.pi


class _Walk:
    """Rays under way: (n, 3) places and directions, (n,) weights, and what the receiver counted of each."""

    def __init__(self, block: Block, response: Angular, random: np.random.Generator, rays: int) -> None:
        self.block, self.response, self.random = block, response, random
        self.place, self.way = np.zeros((rays, 3)), np.zeros((rays, 3))
        self.weight, self.counted = np.ones(rays), np.zeros(rays)
        self.alive = np.arange(rays)
        self.order, self.by_order = np.zeros(rays, dtype=np.int64), np.zeros(ORDERS)
        self.back = outside_reflectance(block.index) if block.index > 1.0 else 0.0

    def step(self) -> None:
        """Trace every ray to its next face, mirror it at the top, or scatter it."""
        block, size, live = self.block, np.array(self.block.size), self.alive
        place, way = self.place[live], self.way[live]
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.where(way > 0.0, (size - place) / way, np.where(way < 0.0, -place / way, np.inf))
        axis = np.argmin(times, axis=1)
        time = times[np.arange(len(live)), axis]
        up = way[np.arange(len(live)), axis] > 0.0
        self.place[live] = np.clip(place + way * time[:, None], 0.0, size)
        self.weight[live] *= np.exp(-block.absorption * time)
        at_top, at_floor = (axis == 2) & up, (axis == 2) & ~up
        self._meet_top(live[at_top])
        self._meet_floor(live[at_floor])
        for k in (0, 1):
            if block.wall is None:
                met = live[axis == k]
                self.weight[met] *= fresnel(np.abs(self.way[met, k]), block.index, 1.0)
                self.way[met, k] *= -1.0
                continue
            for side in (False, True):
                self._scatter(live[(axis == k) & (up == side)], block.wall, k, -1.0 if side else 1.0)
        self.alive = live[self.weight[live] > LAST_WEIGHT]

    def _meet_top(self, rays: np.ndarray) -> None:
        block = self.block
        if block.cover == "wet":
            self._scatter(rays, block.white, 2, -1.0)
            return
        mirrors = fresnel(self.way[rays, 2], block.index, 1.0)
        if block.cover == "bare":
            self.weight[rays] *= mirrors
            self.way[rays, 2] *= -1.0
            return
        mirrored = self.random.random(len(rays)) < mirrors
        self.way[rays[mirrored], 2] *= -1.0
        rays = rays[~mirrored]
        # the cover and the top's outer side reflect in turn: 1 + white back + (white back)^2 ...
        self.weight[rays] *= block.white * (1.0 - self.back) / (1.0 - block.white * self.back)
        self.order[rays] += 1
        self._straight(rays, self._entering)
        outer = np.sqrt(self.random.random(len(rays)))
        self.weight[rays] *= (1.0 - fresnel(outer, 1.0, block.index)) / (1.0 - self.back)
        sine = np.sqrt(1.0 - outer**2) / block.index
        turn = 2.0 * np.pi * self.random.random(len(rays))
        self.way[rays] = np.column_stack([sine * np.cos(turn), sine * np.sin(turn), -np.sqrt(1.0 - sine**2)])

    def _entering(self, cosine: FloatArray) -> FloatArray:
        """Intensity of light from a Lambertian cover in air that has entered the block, by the cosine inside [1/sr]."""
        index = self.block.index
        passes = 1.0 - fresnel(np.maximum(cosine, 0.0), index, 1.0)
        return index**2 * passes * _lambertian(cosine) / (1.0 - self.back)

    def _meet_floor(self, rays: np.ndarray) -> None:
        off = np.abs(self.place[rays, :2] - np.array(self.block.receiver)).max(axis=1)
        inside = off <= self.block.receiver_width / 2
        self.weight[rays[inside]] = 0.0
        self._scatter(rays[~inside], self.block.floor, 2, 1.0)

    def _scatter(self, rays: np.ndarray, share: float, axis: int, sign: float) -> None:
        """Scatter rays at a Lambertian face whose inward normal points along `axis`."""
        if not len(rays):
            return
        self.weight[rays] *= share
        self.order[rays] += 1
        if axis != 2:
            normal = np.zeros(3)
            normal[axis] = sign
            self._straight(rays, _lambertian, normal)
            self.mirrored(rays, _lambertian, normal)
        elif sign < 0.0:
            self._straight(rays, _lambertian)
        else:
            self.mirrored(rays, _lambertian)
        cosine, turn = np.sqrt(self.random.random(len(rays))), 2.0 * np.pi * self.random.random(len(rays))
        sine = np.sqrt(1.0 - cosine**2)
        way = np.empty((len(rays), 3))
        way[:, axis] = sign * cosine
        way[:, (axis + 1) % 3], way[:, (axis + 2) % 3] = sine * np.cos(turn), sine * np.sin(turn)
        self.way[rays] = way

    def _target(self, rays: np.ndarray) -> FloatArray:
        block = self.block
        spread = (self.random.random((len(rays), 2)) - 0.5) * block.receiver_width
        return np.column_stack([np.array(block.receiver) + spread, np.zeros(len(rays))])

    def _targets(self, rays: np.ndarray) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Random points of the receiver's face, then of one of its images in bare sides, each with a factor."""
        target = self._target(rays)
        yield target, np.ones(len(rays))
        if self.block.wall is not None:
            return
        order = np.array(_ALL)[self.random.integers(len(_ALL), size=len(rays))]
        size = np.array(self.block.size[:2])
        image = target.copy()
        image[:, :2] = order * size + np.where(order % 2 == 0, target[:, :2], size - target[:, :2])
        path = image - self.place[rays]
        path[:, 2] = np.where(
            self.place[rays, 2] > self.block.size[2] / 2, path[:, 2], 2.0 * self.block.size[2]
        )
        cosines = np.abs(path[:, :2]) / np.linalg.norm(path, axis=1)[:, None]
        sides = fresnel(cosines, self.block.index, 1.0) ** np.abs(order)
        yield image, len(_ALL) * sides.prod(axis=1)

    def _straight(self, rays: np.ndarray, intensity: Angular, normal: FloatArray | None = None) -> None:
        """Count light from places above the floor straight to the receiver."""
        down = np.array([0.0, 0.0, -1.0]) if normal is None else normal
        for target, share in self._targets(rays):
            self._count(rays, target - self.place[rays], intensity, down, share)

    def mirrored(self, rays: np.ndarray, intensity: Angular, normal: FloatArray | None = None) -> None:
        """Count light that reaches the receiver by the mirroring top."""
        if self.block.cover == "wet" or self.block.index <= 1.0:
            return
        up = np.array([0.0, 0.0, 1.0]) if normal is None else normal
        for target, share in self._targets(rays):
            target[:, 2] = 2.0 * self.block.size[2]
            path = target - self.place[rays]
            top = fresnel(path[:, 2] / np.linalg.norm(path, axis=1), self.block.index, 1.0)
            self._count(rays, path, intensity, up, share * top)

    def _count(
        self,
        rays: np.ndarray,
        path: FloatArray,
        intensity: Angular,
        normal: FloatArray,
        factor: FloatArray,
    ) -> None:
        square = (path**2).sum(axis=1)
        length = np.sqrt(square)
        leaving, arriving = path @ normal / length, np.abs(path[:, 2]) / length
        area = self.block.receiver_width**2
        light = self.weight[rays] * factor * intensity(leaving) * arriving * area / square
        light = light * self.response(arriving) * np.exp(-self.block.absorption * length)
        self.counted[rays] += light
        self.by_order += np.bincount(np.minimum(self.order[rays], ORDERS - 1), light, ORDERS)
