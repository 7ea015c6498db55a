"""Data computed once for a scene, settings and a seed: faces as arrays, the untouched pad's light, sample points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields
from functools import cache
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.kernel_types import StraightRules
from optopad.sims.optics.scene.optical_scene import OpticalScene, PadForm

if TYPE_CHECKING:
    from optopad.sims.optics.surface.tops import Top

Orders = tuple[IntArray, FloatArray, FloatArray]
Kept = TypeVar("Kept")
POINT_SEED = 20170603
PATCH_MM = 2.0
REFERENCE_PATCH_MM = 0.5
"""Size of patches for light scattered once in the untouched pad [mm]. With 1 mm this light was 0.2 to 0.3 % too faint;
0.25 mm gives the same result as 0.5 mm."""
RADIOSITY_PATCHES = 600
BOUNCE_RAYS = 128
"""Rays from each patch that show where its scattered light lands."""
WALL_REFERENCE_RAYS = 65536
"""Rays per emitter and replicate for light mirrored by smooth walls in the untouched pad; a ray counts if it hits a
receiver."""
PHASE_SPREAD = 0.3
REMEMBERED_PADS = 8
DARK_SCALE = 1e-3
"""Flux used as the scale for an emitter that lights no receiver, as a scale must be above 0 [-]."""


@dataclass(frozen=True, kw_only=True)
class UnshiftedPad:
    """The part of the untouched pad's light that does not depend on the seed.

    Attributes
    ----------
    box, emitters, receivers : arrays for the kernels; see `optopad.sims.optics.surface.radial`
    straight : (2, emitter, receiver) direct flux and flux mirrored by the top
    diffuse : (emitter, receiver) scattered flux
    given, taken : (emitter, patch) and (receiver, patch) light deposited on patches
    joined : (emitter, receiver) scattered flux computed from these deposits
    orders : layout, areas and transfer of the patches for light scattered more than once; see
        `optopad.sims.optics.engine.repeated`
    points : (ray, 4) Sobol points in the unit cube
    layout, areas, reflectances : data of the patches; see `optopad.sims.optics.engine.scattered`
    """

    box: FloatArray
    emitters: FloatArray
    receivers: FloatArray
    straight: FloatArray
    diffuse: FloatArray
    given: FloatArray
    taken: FloatArray
    joined: FloatArray
    orders: Orders
    points: FloatArray
    layout: IntArray
    areas: FloatArray
    reflectances: FloatArray


@dataclass(frozen=True, kw_only=True)
class Untouched(UnshiftedPad):
    """Untouched light of a pad for one seed, with the offsets that all states use.

    Attributes
    ----------
    shifts : (replicate, 8) offsets of grids and rays
    wall : (replicate, emitter, receiver) flux mirrored by smooth walls
    rays : deposits by emitters, deposits by receivers, and flux mirrored by walls, per replicate, from the rays that
        pressed states use between smooth walls
    scale : (emitter, receiver) flux summed over classes; 0 is replaced as by `above_zero`
    gain : (emitter, receiver) ratio of the direct flux to its value by the coarser rule that pressed states use.
        States' direct flux is multiplied by this, so a press that hides nothing changes nothing
    """

    shifts: FloatArray
    wall: FloatArray
    rays: tuple[FloatArray, FloatArray, FloatArray]
    scale: FloatArray
    gain: FloatArray


_UNSHIFTED: dict[str, UnshiftedPad] = {}
_UNTOUCHED: dict[str, Untouched] = {}
"""Untouched pads remembered in this process, keyed by all inputs that determine them."""


def untouched_pad(scene: OpticalScene, settings: Accuracy, seed: int) -> Untouched:
    """Untouched light of a scene, remembered within this process; data common to several seeds is shared."""
    content = "|".join(_content_of(getattr(scene, field.name)) for field in dataclass_fields(scene))

    def unshifted() -> UnshiftedPad:
        rays = _most_rays(scene, settings)
        key = f"{content}|{settings.flat_nodes}|{settings.reference_rays}|{rays}"
        return _remembered(_UNSHIFTED, key, lambda: _solved(scene, settings, rays))

    return _remembered(
        _UNTOUCHED, f"{content}|{settings}|{seed}", lambda: _shifted(scene, unshifted(), settings, seed)
    )


def _content_of(value: object) -> str:
    """A field of a scene as text; different values have different texts."""
    if value is None or isinstance(value, PadForm | str):
        return repr(value)
    return np.asarray(value, dtype=np.float64).tobytes().hex()


def _remembered(store: dict[str, Kept], key: str, made: Callable[[], Kept]) -> Kept:
    """Entry of a dictionary, computed if it is missing; the oldest entry is dropped if there are too many."""
    found = store.get(key)
    if found is None:
        found = made()
        if len(store) >= REMEMBERED_PADS:
            store.pop(next(iter(store)), None)
        store[key] = found
    return found


@cache
def gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def packed(scene: OpticalScene) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Box (6,), emitters (e, 7 or more), receivers (r, 7 or more); faces are clipped to the clear layer."""
    box = np.array(
        [
            scene.length_mm, scene.width_mm, scene.height_mm, scene.refractive_index, scene.absorption_per_mm,
            scene.wall_index or 0.0,
        ]
    )  # fmt: skip
    bare = np.ones(len(scene.receiver_wall))
    emitters = _clipped(scene.emitter_wall, scene.emitter_patch, scene.emitter_order, scene.height_mm)
    receivers = _clipped(scene.receiver_wall, scene.receiver_patch, bare, scene.height_mm)
    receivers[:, 6] = 4 * receivers[:, 3] * receivers[:, 4]
    response = None if scene.receiver_response is None else scene.receiver_response / np.pi
    return box, _with_table(emitters, scene.emitter_pattern), _with_table(receivers, response)


def _clipped(walls: IntArray, patches: FloatArray, orders: FloatArray, height: float) -> FloatArray:
    low = np.clip(patches[:, 1] - patches[:, 3], 0.0, height)
    high = np.clip(patches[:, 1] + patches[:, 3], 0.0, height)
    full_area = 4 * patches[:, 2] * patches[:, 3]
    return np.column_stack(
        [walls, patches[:, 0], (low + high) / 2, patches[:, 2], (high - low) / 2, orders, full_area]
    ).astype(np.float64)


def _with_table(rows: FloatArray, table: FloatArray | None) -> FloatArray:
    """Rows with their radiance tables appended and their order set to -1, except where the table has a NaN."""
    if table is None:
        return rows
    given = np.asarray(np.isfinite(table).all(axis=1))
    rows[given, 5] = -1.0
    return np.hstack([rows, np.where(given[:, None], table, 0.0)])


def straight_rules(settings: Accuracy) -> StraightRules:
    """Gauss nodes and weights for the direct light under a press."""
    counts = (settings.nodes_emitter, settings.nodes_column, settings.nodes_height)
    one, two, three = (gauss(count) for count in counts)
    return *one, *two, *three


def _no_press(box: FloatArray) -> Top:
    from optopad.sims.optics.surface.curves import HIGHEST, LOWEST, ROW, TOP
    from optopad.sims.optics.surface.tops import Top

    row = np.zeros(ROW)
    row[[TOP, LOWEST, HIGHEST]] = box[2]
    return Top(row, np.zeros((0, 0, 16)))


@dataclass(frozen=True, kw_only=True)
class _Parts:
    """Data of a scene that every sum of scattered light in the untouched pad needs."""

    box: FloatArray
    emitters: FloatArray
    receivers: FloatArray
    points: FloatArray
    reflectances: FloatArray

    def deposits(
        self, shift: FloatArray, count: int, layout: IntArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Deposits (emitter, patch) and (receiver, patch), and (emitter, receiver) flux mirrored by walls."""
        from optopad.sims.optics.engine import compiled

        first_e, first_r = compiled.EMITTER_SEQUENCE, compiled.RECEIVER_SEQUENCE
        rest = (self.receivers, self.box, _no_press(self.box), self.points, count, shift)
        given, seen = compiled.untouched_deposits(self.emitters, False, *rest, first_e, layout)
        taken, _ = compiled.untouched_deposits(self.receivers, True, *rest, first_r, layout)
        return given, taken, seen

    def joined(self, given: FloatArray, taken: FloatArray, layout: IntArray, areas: FloatArray) -> FloatArray:
        """(emitter, receiver) flux scattered once, from deposits (emitter, patch) and (receiver, patch)."""
        from optopad.sims.optics.engine import compiled

        return np.asarray(compiled.joined(given, taken, self.receivers, areas, layout, self.reflectances))

    def scattered(
        self,
        given: FloatArray,
        taken: FloatArray,
        patches: tuple[IntArray, FloatArray],
        orders: Orders,
    ) -> FloatArray:
        """(emitter, receiver) flux scattered once or more, from deposits (emitter, patch) and (receiver, patch)."""
        from optopad.sims.optics.engine import compiled

        return np.asarray(
            compiled.scattered(
                given,
                taken,
                self.receivers,
                patches,
                self.reflectances,
                orders,
                self.box,
                _no_press(self.box),
            )
        )

    def orders(self) -> Orders:
        """Data for light scattered more than once: layout, areas and transfer of patches."""
        from optopad.sims.optics.engine import compiled

        box = self.box
        surface = 2 * (box[0] + box[1]) * box[2] + box[0] * box[1]
        layout = compiled.patch_layout(box, max(PATCH_MM, float(np.sqrt(surface / RADIOSITY_PATCHES))))
        areas = compiled.patch_areas(layout, self.receivers, box)
        shares = compiled.bounce_matrix(layout, self.receivers, box, _no_press(box), self.points, BOUNCE_RAYS)
        per_patch = np.repeat(self.reflectances, layout[:, 0] * layout[:, 1])[: len(shares), None]
        whole = np.eye(len(shares))
        return layout, areas, np.linalg.inv(whole - per_patch * shares) - whole


def _shifts(settings: Accuracy, seed: int) -> FloatArray:
    """(replicate, 8) offsets of grids in their cells, of rays, and of the search grid.

    Offsets in cells are evenly spread over the replicates, and each has its mirror image about the cell's middle. So
    the mean over replicates is exact for functions that vary linearly within a cell.
    """
    count = settings.replicates
    shifts = np.random.default_rng(seed).random((count, 8))
    base = 0.5 / count + PHASE_SPREAD / count * (shifts[0, :2] - 0.5)
    shifts[:, :2] = (base + np.arange(count)[:, None] / count) % 1.0
    shifts[:, 1] = np.roll(shifts[:, 1], count // 2)
    half = count // 2
    shifts[-half:, :2] = 1.0 - shifts[:half, :2][::-1]
    shifts[:, 6:] = 0.5 + PHASE_SPREAD * (shifts[0, 6:] - 0.5)
    return shifts


def _most_rays(scene: OpticalScene, settings: Accuracy) -> int:
    """Largest number of rays that the untouched pad or a state sends from a face."""
    wall_reference = _wall_reference_rays(settings) if scene.wall_index else 0
    return max(wall_reference, settings.reference_rays, settings.wall_rays, 1024)


def _wall_reference_rays(settings: Accuracy) -> int:
    return max(settings.reference_rays, WALL_REFERENCE_RAYS)


def _solved(scene: OpticalScene, settings: Accuracy, rays: int) -> UnshiftedPad:
    from scipy.stats import qmc

    from optopad.sims.kernels import compile_beside
    from optopad.sims.optics.engine import compiled

    compile_beside("optopad.sims.optics.compiling", compiled.trace_further)
    box, emitters, receivers = packed(scene)
    points = qmc.Sobol(4, scramble=True, rng=POINT_SEED).random(rays)
    reflectances = np.array([scene.wall_reflectance] * 4 + [scene.bottom_reflectance, scene.tip_reflectance])
    parts = _Parts(box=box, emitters=emitters, receivers=receivers, points=points, reflectances=reflectances)
    layout = compiled.patch_layout(box, PATCH_MM)
    areas = compiled.patch_areas(layout, receivers, box)
    given, taken, _ = parts.deposits(np.zeros(4), settings.reference_rays, layout)
    finer = compiled.patch_layout(box, REFERENCE_PATCH_MM)
    first = parts.joined(
        *parts.deposits(np.zeros(4), settings.reference_rays, finer)[:2],
        finer,
        compiled.patch_areas(finer, receivers, box),
    )
    orders = parts.orders()
    every, once = (
        parts.scattered(given, taken, (layout, areas), orders),
        parts.joined(given, taken, layout, areas),
    )
    diffuse = first * np.divide(every, once, out=np.ones_like(once), where=once > 0)
    straight = compiled.flat_matrix(emitters, receivers, box, 3 * gauss(settings.flat_nodes))
    return UnshiftedPad(
        box=box, emitters=emitters, receivers=receivers, straight=straight, diffuse=diffuse, given=given, taken=taken,
        joined=every, orders=orders, points=points, layout=layout, areas=areas, reflectances=reflectances,
    )  # fmt: skip


def _shifted(scene: OpticalScene, pad: UnshiftedPad, settings: Accuracy, seed: int) -> Untouched:
    """The untouched pad's light with the offsets of a seed, including rays between smooth walls."""
    from optopad.sims.optics.engine import compiled

    shifts = _shifts(settings, seed)
    wall = np.zeros((len(shifts), len(pad.emitters), len(pad.receivers)))
    none = np.zeros((len(shifts), 0, 0))
    rays = (none, none, none)
    if scene.wall_index:
        parts = _Parts(
            box=pad.box,
            emitters=pad.emitters,
            receivers=pad.receivers,
            points=pad.points,
            reflectances=pad.reflectances,
        )
        count = _wall_reference_rays(settings)
        wall = np.stack([parts.deposits(shift[2:6], count, pad.layout)[2] for shift in shifts])
        per = [parts.deposits(shift[2:6], settings.wall_rays, pad.layout) for shift in shifts]
        rays = (np.stack([x[0] for x in per]), np.stack([x[1] for x in per]), np.stack([x[2] for x in per]))
    total = pad.straight.sum(axis=0) + pad.diffuse + wall.mean(axis=0)
    rule = compiled.flat_matrix(pad.emitters, pad.receivers, pad.box, straight_rules(settings))[0]
    return Untouched(
        **{field.name: getattr(pad, field.name) for field in dataclass_fields(pad)},
        shifts=shifts,
        wall=wall,
        rays=rays,
        scale=above_zero(total),
        gain=np.divide(pad.straight[0], rule, out=np.ones_like(rule), where=rule > 0),
    )


def above_zero(flux: FloatArray) -> FloatArray:
    """(emitter, receiver) flux with 0 replaced by the mean of the emitter's lit pairs (`DARK_SCALE` if none is lit)."""
    lit = flux > 0
    mean = flux.sum(axis=1) / np.maximum(lit.sum(axis=1), 1)
    return np.asarray(np.where(lit, flux, np.where(mean > 0, mean, DARK_SCALE)[:, None]))
