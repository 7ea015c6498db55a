"""Data shared by all states of a disc or crowned pad: untouched light, and sample points and rays for presses. The
untouched pad is traced once, more finely than any press. The change by a press is the difference of the light at the
same points and rays with and without the press. The light without the press is stored here, too.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from functools import cached_property, lru_cache

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.sims.compiling import listen_to_numba
from optopad.sims.optics.accuracy import Accuracy
from optopad.sims.optics.engine.general.lower import formed_top, walls_of, windows_of
from optopad.sims.optics.engine.general.mirrored import CELL_MM
from optopad.sims.optics.engine.general.patches import PatchLayout, patch_layout
from optopad.sims.optics.engine.general.points import GridPoints, TopGrid, pitch_of, points_of, top_grid
from optopad.sims.optics.engine.general.rays import AREA, CX, CY, CZ, HALF_U, HALF_V, NZ, TABLE
from optopad.sims.optics.engine.general.scattered import DIMENSIONS, DIMENSIONS_UNDER_SKIN
from optopad.sims.optics.engine.general.top import FLAT, GRID_STEP, KIND, SPHERE, FormedTop
from optopad.sims.optics.engine.threads import run_each
from optopad.sims.optics.engine.untouched import above_zero
from optopad.sims.optics.scene.optical_scene import OpticalScene

CLASSES = 5
REFERENCE = Accuracy(image_step=0.06)
REFERENCE_GRIDS = 2
"""Accuracy settings for the grid on the untouched top, and number of such grids with different offsets."""
REFERENCE_PATCH_MM, PATCHES_ERROR = 0.5, 3e-3
"""Size of patches for light scattered once in the untouched pad [mm], and the relative error that this size causes
[-]."""
REFERENCE_RAYS, REFERENCE_WALKS = 32768, 8
"""Rays per emitter for the untouched pad's scattered light, and number of groups with different offsets. If the
settings have fewer rays, fewer are used here, too, and the grid's cells grow by the square root of the ratio."""
DEPOSIT_RAYS, DEPOSIT_RAYS_UNDER_SKIN, SKIN_RAYS = 2048, 512, 1024
"""Rays per part for light on patches, fewer under a skin that scatters, where other errors are larger; and per emitter
for light that the skin scatters twice or more."""
PART_SHARE, SPHERE_PART_SHARE = 0.3, 0.15
"""Largest size of a part of an emitter, relative to its distance from a point of the top. It is smaller under a
spherical crown, whose repeated reflections focus light in both directions. `chains` begins with larger parts and
divides them."""
CHAINS_ERROR = 3e-3
"""Relative error of light mirrored several times by an untouched crown [-]. With emitters divided into smaller parts,
its sum changes by 5e-4, and that of single pairs under a small press by up to this error."""
FINER_LATTICE = 2.0**-1.5
"""Ratio of a grid's error to that of a grid with every other point, for a function with jumps."""
STRAIGHT_NODES, LEAST_NODES = 12, (5, 24, 4)
"""Number of Gauss nodes for direct light: in each direction for the untouched pad; and the smallest numbers under a
press, over the emitter, the receiver's columns and the height of a column."""
MOST_CELLS = 4_000_000
"""Largest table of distances to receivers that look up; larger ones take more memory than they save time."""
MOST_MIRRORED = 1000
_MIRRORED: dict[bytes, FloatArray] = {}
_LOCK = threading.Lock()
"""Lock of `_MIRRORED`, which remembers up to `MOST_MIRRORED` results of mirrored light; pads that differ only in
scattering share them."""


@dataclass(frozen=True, kw_only=True)
class FormedPad:
    """Untouched light of a disc or crowned pad, and functions that trace its light under any top.

    Attributes
    ----------
    scene : the pad
    emitters, receivers : faces, from `lower.windows_of`
    walls, arcs : flat and round walls, from `lower.walls_of`
    top : the untouched top
    patches : patches of walls and bottom for scattered light
    flux : (class, emitter, receiver) untouched flux [-]
    error : (emitter, receiver) standard error of the flux summed over classes [-]
    """

    scene: OpticalScene
    emitters: FloatArray
    receivers: FloatArray
    walls: FloatArray
    arcs: FloatArray
    top: FormedTop
    patches: PatchLayout
    flux: FloatArray
    error: FloatArray

    @cached_property
    def scale(self) -> FloatArray:
        """(emitter, receiver) flux summed over classes, made positive to serve as a scale [-]."""
        return above_zero(np.asarray(self.flux.sum(axis=0)))

    @cached_property
    def mirrors(self) -> float:
        """Refractive index of a bare top, which mirrors Fresnel's share; minus the share that a skin mirrors."""
        if self.scene.top_finish == "bare":
            return self.scene.refractive_index
        return -self.scene.top_reflectance if self.scene.top_finish == "specular" else 0.0

    @cached_property
    def steps(self) -> FloatArray:
        """Steps of the random sequence, one per random number of a ray."""
        return sequence_steps(dimensions_of(self.scene))

    def _near(self, wanted: BoolArray) -> FloatArray:
        """Distances to the requested receivers that look up, as `mirrored_flux` takes them; empty if not in a plane."""
        away = self._away
        return np.ascontiguousarray(away[wanted.any(axis=0)].min(axis=0)) if len(away) else np.zeros((0, 0))

    @cached_property
    def _away(self) -> FloatArray:
        """(receiver, x, y) least distance of cells to each receiver; empty unless all look up and are equally high."""
        faces = self.receivers
        cells = len(faces) * self.scene.length_mm * self.scene.width_mm / CELL_MM**2
        if (faces[:, NZ] != -1.0).any() or np.ptp(faces[:, CZ]) > 0.0 or cells > MOST_CELLS:
            return np.zeros((0, 0, 0))
        x, y = (
            (np.arange(int(side / CELL_MM) + 1) + 0.5) * CELL_MM
            for side in (self.scene.length_mm, self.scene.width_mm)
        )
        away = np.hypot(x[:, None] - faces[:, None, None, CX], y - faces[:, None, None, CY])
        return np.asarray(away - np.hypot(faces[:, HALF_U], faces[:, HALF_V])[:, None, None] - CELL_MM)

    @property
    def every(self) -> BoolArray:
        """(emitter, receiver) mask with all pairs."""
        return np.ones((len(self.emitters), len(self.receivers)), dtype=np.bool_)

    def straight(self, top: FormedTop, wanted: BoolArray, rules: tuple[FloatArray, ...]) -> FloatArray:
        """(emitter, receiver) direct light of the requested pairs under a top."""
        from optopad.sims.optics.engine.general.kernels import straight_matrix

        absorbs = self.scene.absorption_per_mm
        return np.asarray(straight_matrix(self.emitters, self.receivers, wanted, absorbs, *top, *rules))

    def mirrored(self, top: FormedTop, wanted: BoolArray, at: FloatArray) -> FloatArray:
        """(2, batch, emitter, receiver) light returned at points of a top: by its smooth part, and by the skirt.

        A bare top or a specular skin mirrors it; of a diffuse skin it is the light scattered once, there.

        `at` (n, 5) has the points in press coordinates; `GridPoints.in_frame` explains the columns.
        """
        from optopad.sims.optics.engine.general.kernels import mirrored_matrix, points_on, skin_matrix

        scene = self.scene
        share = SPHERE_PART_SHARE if top.numbers[KIND] == SPHERE else PART_SHARE
        places = np.ascontiguousarray(at)
        absorbs, index = scene.absorption_per_mm, self.mirrors

        def traced() -> FloatArray:
            if scene.top_finish == "diffuse":
                return np.asarray(
                    skin_matrix(
                        self.emitters, self.receivers, wanted, points_on(places, *top), scene.top_reflectance, absorbs,
                        *top,
                    )
                )  # fmt: skip
            return np.asarray(
                mirrored_matrix(
                    self.emitters, self.receivers, wanted, points_on(places, *top), share, absorbs, index, self.walls,
                    self.arcs, self._near(wanted), *top,
                )
            )  # fmt: skip

        if top.numbers[GRID_STEP] > 0.0:  # large to name, and hardly ever traced twice
            return traced()
        name = _name_of(
            self.emitters, self.receivers, wanted, places, self.walls, self.arcs, *top,
            np.array([share, absorbs, index, scene.top_reflectance]),
        )  # fmt: skip
        known = _MIRRORED.get(name)
        if known is None:
            known = traced()
            with _LOCK:
                _MIRRORED[name] = known
                if len(_MIRRORED) > MOST_MIRRORED:
                    del _MIRRORED[next(iter(_MIRRORED))]
        return known.copy()

    def deposits(
        self,
        top: FormedTop,
        wanted: BoolArray,
        shift: FloatArray,
        patches: PatchLayout | None = None,
        rays: int | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """(batch, emitter, patch) and (batch, receiver, patch) light on patches from those requested."""
        from optopad.sims.optics.engine.general.kernels import deposit_matrix

        scene, layout = self.scene, patches or self.patches
        rays = rays or (DEPOSIT_RAYS_UNDER_SKIN if scene.top_finish == "diffuse" else DEPOSIT_RAYS)
        given, taken = (
            deposit_matrix(
                windows, asked, self.receivers, rays, self.steps, shift + 0.25 * k,
                scene.absorption_per_mm, self.mirrors, self.walls, self.arcs, *top,
                layout.numbers, len(layout.weight),
            )
            for k, (windows, asked) in enumerate(
                ((self.emitters, np.any(wanted, axis=1)), (self.receivers, np.any(wanted, axis=0)))
            )
        )  # fmt: skip
        return given, taken

    def again(self, top: FormedTop, wanted: BoolArray, shift: FloatArray) -> FloatArray:
        """(batch, emitter, receiver) light that only a diffuse skin scatters, twice or more."""
        from optopad.sims.optics.engine.general.kernels import skin_again_matrix

        scene = self.scene
        return np.asarray(
            skin_again_matrix(
                self.emitters, self.receivers, wanted, SKIN_RAYS, self.steps, shift, scene.top_reflectance,
                scene.absorption_per_mm, self.walls, self.arcs, *top,
            )
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class FormedWays:
    """Sample points, rays and untouched light that settings and a seed determine for all states of a pad.

    Attributes
    ----------
    pad : untouched light
    settings : the accuracy
    grid : cells of the top
    points : for each replicate, one point in each cell
    shifts : (replicate, 2) positions of the points in their cells
    mirrored : (replicate, 2, batch, emitter, receiver) light mirrored at these points by the untouched top
    rays : (replicate, n) offsets of rays
    deposits : for each replicate, light of these rays on patches in the untouched pad
    rules : Gauss nodes and weights of direct light
    straight : (emitter, receiver) direct light by these nodes in the untouched pad
    """

    pad: FormedPad
    settings: Accuracy
    grid: TopGrid
    points: tuple[GridPoints, ...]
    shifts: FloatArray
    mirrored: FloatArray
    rays: FloatArray
    deposits: tuple[tuple[FloatArray, FloatArray], ...]
    rules: tuple[FloatArray, ...]
    straight: FloatArray


def _name_of(*arrays: FloatArray | BoolArray) -> bytes:
    """Hash of arrays by type, shape and content."""
    digest = hashlib.blake2b(digest_size=16)
    for one in arrays:
        digest.update(repr((one.dtype.str, one.shape)).encode())
        digest.update(one.tobytes())
    return digest.digest()


class _Key:
    """A scene as a dictionary key; scenes of equal content have equal keys."""

    def __init__(self, scene: OpticalScene) -> None:
        self.scene = scene
        values = [getattr(scene, field.name) for field in dataclass_fields(scene)]
        self._text = repr([one.tolist() if isinstance(one, np.ndarray) else one for one in values])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)


def formed_ways(scene: OpticalScene, settings: Accuracy, seed: int) -> FormedWays:
    """Untouched light, sample points and rays of a scene for settings and a seed, remembered within this process."""
    return _remembered_ways(_Key(scene), settings, seed)


@lru_cache(maxsize=8)
def _remembered_ways(key: _Key, settings: Accuracy, seed: int) -> FormedWays:
    pad, scene = _remembered_pad(key, seed, min(settings.reference_rays // 2, REFERENCE_RAYS)), key.scene
    windows = _all_windows(pad)
    grid = top_grid(scene, windows, pitch_of(settings, pad.scene, pad.emitters, pad.receivers))
    count = settings.replicates
    random = np.random.default_rng((seed, 1))
    shifts = np.asarray((random.random(2) + np.arange(count)[:, None] / count) % 1.0)
    all_chains = pad.top.numbers[KIND] == SPHERE
    points = tuple(
        points_of(grid, scene, pad.walls, pad.arcs, shift, all_chains=all_chains) for shift in shifts
    )
    mirrored = np.zeros((count, 2, 4, *pad.every.shape))
    rays = random.random((count, dimensions_of(scene)))
    deposits: list[tuple[FloatArray, FloatArray]] = [(np.empty(0), np.empty(0))] * count

    def one(number: int) -> None:
        mirrored[number] = pad.mirrored(pad.top, pad.every, points[number].in_frame(pad.top))
        deposits[number] = pad.deposits(pad.top, pad.every, rays[number])

    run_each(one, count)
    nodes = (settings.nodes_emitter, settings.nodes_column, settings.nodes_height)
    rules = straight_rules(*(max(count, least) for count, least in zip(nodes, LEAST_NODES, strict=True)))
    return FormedWays(
        pad=pad, settings=settings, grid=grid, points=points, shifts=shifts, mirrored=mirrored, rays=rays,
        deposits=tuple(deposits), rules=rules, straight=pad.straight(pad.top, pad.every, rules),
    )  # fmt: skip


@lru_cache(maxsize=4)
def _remembered_pad(key: _Key, seed: int, rays: int) -> FormedPad:
    listen_to_numba()
    scene = key.scene
    walls, arcs = walls_of(scene)
    emitters, receivers = windows_of(scene, "emitter"), windows_of(scene, "receiver")
    dark = np.zeros((CLASSES, len(emitters), len(receivers)))
    pad = FormedPad(
        scene=scene, emitters=emitters, receivers=receivers, walls=walls, arcs=arcs,
        top=formed_top(scene, np.zeros(2), None), patches=patch_layout(scene, walls, arcs), flux=dark,
        error=dark[0],
    )  # fmt: skip
    random = np.random.default_rng((seed, 0))
    step = REFERENCE.image_step * np.sqrt(REFERENCE_RAYS / rays)
    mirrored = _untouched_mirrored(pad, random.random(2), replace(REFERENCE, image_step=step))
    shifts = random.random((REFERENCE_WALKS, dimensions_of(scene)))
    once, walks = _untouched_once(pad, shifts[0], rays), _untouched_more(pad, shifts, rays)
    direct = pad.straight(pad.top, pad.every, straight_rules(STRAIGHT_NODES, STRAIGHT_NODES, STRAIGHT_NODES))
    flux = dark.copy()
    flux[0], flux[1:3], flux[4] = direct, mirrored.sum(axis=2).mean(axis=0), once[0] + walks.mean(axis=0)
    walked = walks.std(axis=0, ddof=1) / np.sqrt(REFERENCE_WALKS)
    chains = CHAINS_ERROR * (pad.top.numbers[KIND] != FLAT) * flux[1]
    error = np.sqrt(lattice_error(mirrored) ** 2 + once[1] ** 2 + walked**2 + chains**2)
    given = {field.name: getattr(pad, field.name) for field in dataclass_fields(pad)}
    return FormedPad(**(given | {"flux": flux, "error": error}))


def _untouched_mirrored(pad: FormedPad, shift: FloatArray, settings: Accuracy) -> FloatArray:
    """(grid, 2, batch, emitter, receiver) light mirrored by the untouched top, by grids with different offsets."""
    windows = _all_windows(pad)
    grid = top_grid(pad.scene, windows, pitch_of(settings, pad.scene, pad.emitters, pad.receivers))
    out = np.zeros((REFERENCE_GRIDS, 2, 4, *pad.every.shape))

    def one(number: int) -> None:
        moved = (shift + number / REFERENCE_GRIDS) % 1.0
        points = points_of(grid, pad.scene, pad.walls, pad.arcs, moved, all_chains=True)
        out[number] = pad.mirrored(pad.top, pad.every, points.in_frame(pad.top))

    run_each(one, REFERENCE_GRIDS)
    return out


def _untouched_once(pad: FormedPad, shift: FloatArray, rays: int) -> tuple[FloatArray, FloatArray]:
    """(emitter, receiver) light scattered once in the untouched pad, from fine patches, and its standard error."""
    patches = patch_layout(pad.scene, pad.walls, pad.arcs, REFERENCE_PATCH_MM)
    found, error = jackknifed(
        pad.deposits(pad.top, pad.every, shift, patches, rays),
        lambda given, taken: (given * patches.weight) @ taken.T * pad.receivers[:, AREA],
    )
    return found, np.hypot(error, PATCHES_ERROR * found)


def _untouched_more(pad: FormedPad, shifts: FloatArray, rays: int) -> FloatArray:
    """(shift, emitter, receiver) light scattered more than once, for each offset of the random sequence."""
    from optopad.sims.optics.engine.general.kernels import scattered_matrix

    scene = pad.scene
    out = np.zeros((len(shifts), *pad.every.shape))
    reflectances = np.array([scene.wall_reflectance, scene.bottom_reflectance, scene.tip_reflectance])

    def one(number: int) -> None:
        out[number] = scattered_matrix(
            pad.emitters, pad.receivers, rays // len(shifts), pad.steps, shifts[number],
            scene.absorption_per_mm, pad.mirrors, reflectances, pad.walls, pad.arcs, *pad.top,
        )[1]  # fmt: skip

    run_each(one, len(shifts))
    return out


def jackknifed(
    deposits: tuple[FloatArray, FloatArray], joined: Callable[[FloatArray, FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Value of a function of all rays' deposits, and its standard error by jackknife: each batch is left out in turn.

    deposits : (batch, emitter, patch) and (batch, receiver, patch) light on patches
    joined : the function; it takes both deposits summed over batches
    """
    given, taken = deposits
    count = len(given)
    more = count / (count - 1.0)
    whole = [given.sum(axis=0), taken.sum(axis=0)]
    less = [
        joined((whole[0] - one) * more, (whole[1] - other) * more)
        for one, other in zip(given, taken, strict=True)
    ]
    return joined(*whole), np.asarray(np.sqrt(np.var(less, axis=0) * (count - 1.0)))


def lattice_error(mirrored: FloatArray, apart: FloatArray | None = None) -> FloatArray:
    """(emitter, receiver) standard error of `mirrored` (grid, 2, batch, emitter, receiver), light from grids of points.

    Each batch is a grid with every other point. Its error times `FINER_LATTICE` is a bound for the error of all batches
    together. If whole grids differ by more than that, their spread is used. `apart`, of the same shape, has the
    batches' errors if they are not those of `mirrored`.
    """
    count, batches = mirrored.shape[0], mirrored.shape[2]
    alone = (mirrored if apart is None else apart).sum(axis=1) * batches
    within = np.sqrt(alone.var(axis=1, ddof=1).mean(axis=0)) * FINER_LATTICE
    between = (mirrored.sum(axis=1) * batches).mean(axis=1).std(axis=0, ddof=1) if count > 1 else 0.0
    return np.asarray(np.maximum(within, between) / np.sqrt(count))


def straight_rules(emitter: int, column: int, height: int) -> tuple[FloatArray, ...]:
    """Gauss nodes and weights over the emitter, the receiver's columns and the height of a column."""
    rules = [np.polynomial.legendre.leggauss(count) for count in (emitter, column, height)]
    return tuple(part for rule in rules for part in rule)


def dimensions_of(scene: OpticalScene) -> int:
    """Number of random numbers of a ray in a scene."""
    return DIMENSIONS_UNDER_SKIN if scene.top_finish == "diffuse" else DIMENSIONS


def sequence_steps(dimensions: int) -> FloatArray:
    """(dimensions,) steps of Roberts' additive sequence: powers of 1/x, with x^(d + 1) = x + 1 in d dimensions."""
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    return np.asarray((1.0 / root) ** np.arange(1, dimensions + 1))


def _all_windows(pad: FormedPad) -> FloatArray:
    """(n, 16) faces of emitters, then of receivers, without their tables."""
    return np.vstack([pad.emitters[:, :TABLE], pad.receivers[:, :TABLE]])
