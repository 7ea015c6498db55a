# mypy: allow-untyped-calls
"""Trace every pair of a scene through pressed tops: flux by path class, with a standard error.

Model
-----
Geometric optics in a block of one index whose top is the deformed surface: unpolarised Fresnel and total
reflection at the top, Beer-Lambert absorption along every path, an absorbing or diffuse tip inside the
contact, diffuse walls and bottom, absorbing receiver faces. Light that leaves through the top is lost.

Path classes: `direct` straight light, occluded by the dimple; `top` specular chains whose every reflection
is outside the skirt radius (the outermost radius where the surface is steeper than 0.1); `skirt` specular
chains with a reflection inside it; `diffuse` light scattered at least once. Everything mirrored by the top
is `top` + `skirt`.

Method: straight and flat-mirrored light by quadrature with an analytic horizon (`direct`); one reflection at
the gently curved part path by path (`mirror`), elsewhere as an integral over the top (`skirt`); more
reflections by common random points (`repeated`); diffuse light by joined deposits (`diffuse`), as a ratio to
the untouched pad, whose orders beyond the first come from a patch radiosity. Replicates with independent
offsets give the standard error.

The standard error covers cell placement, sampled chains and the sampled part of diffuse light. It does not
cover: the Gauss rules of straight light (order `nodes_*`), shadow edges inside a cell's light (12 to 18
points), image features that the coarse cells miss (at `standard` about -0.01 % of the signal in the mean), the
finite patch size, higher diffuse orders, which keep their untouched ratio, and chains beyond 24 reflections.
With two replicates it has one degree of freedom for each pair: pool it over pairs or states before you rely
on it. Light with two or more reflections is sampled for the wanted pairs, so a pair mask changes it within
that error; everything else is the same to the bit.

Left out: roughness and haze, glossy walls, polarisation, several tips, sockets and part bodies behind
the walls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError
from sims.indentation import Indentation
from sims.optics.checks import check_scene, wanted_pairs
from sims.optics.scene import OpticalScene
from sims.optics.surface import SKIRT_R, SurfaceStack, stack_surfaces

FloatArray = NDArray[np.float64]
CLASS_NAMES = ("direct", "top", "skirt", "diffuse")
POINT_SEED = 20170603
BATCH_STATES = 32
REFERENCE_PATCH_MM = 1.0
RADIOSITY_PATCHES = 600


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """How finely the light is integrated.

    Attributes
    ----------
    replicates : independent offsets, 2 or more [-]
    rings, sectors : coarse cells of the top around the press [-]
    cell_tolerance : share of its size by which a receiver's image may move across a coarse cell [-]
    cell_share : share of a pair's untouched flux by which a cell's two rules may differ [-]
    calm_share : curvature up to which light is mirrored path by path, over what folds an image [-]
    chain_rings, chain_sectors : first pass for repeated reflections [-]
    chain_share : share of the brightest pair's flux per sample of repeated reflections [-]
    diffuse_rays : rays per emitter and receiver, a power of two [-]
    nodes_emitter, nodes_column, nodes_height : Gauss nodes of straight light [-]
    mirror_emitter, mirror_receiver : Gauss nodes of light mirrored by the calm part of the top [-]
    flat_nodes : Gauss nodes of the untouched pad [-]
    reference_rays : rays per emitter and receiver for the untouched pad's diffuse light [-]
    """

    replicates: int = 2
    rings: int = 10
    sectors: int = 32
    cell_tolerance: float = 0.45
    cell_share: float = 3e-4
    calm_share: float = 0.5
    chain_rings: int = 12
    chain_sectors: int = 40
    chain_share: float = 1e-3
    diffuse_rays: int = 1024
    nodes_emitter: int = 4
    nodes_column: int = 16
    nodes_height: int = 4
    flat_nodes: int = 12
    mirror_emitter: int = 3
    mirror_receiver: int = 5
    reference_rays: int = 16384


ACCURACIES = {
    "draft": Accuracy(cell_tolerance=0.6, cell_share=3e-3, diffuse_rays=512, chain_share=4e-3),
    "standard": Accuracy(),
    "fine": Accuracy(
        cell_tolerance=0.2,
        cell_share=2e-5,
        diffuse_rays=4096,
        chain_share=2e-5,
        chain_rings=24,
        chain_sectors=96,
        nodes_emitter=6,
        nodes_column=32,
        nodes_height=6,
        mirror_emitter=4,
        mirror_receiver=6,
    ),
}


@dataclass(frozen=True, kw_only=True)
class RawLight:
    """Flux over emitted power.

    Attributes
    ----------
    flux : (class, state, emitter, receiver), classes in the order of `CLASS_NAMES` [-]
    standard_error : (state, emitter, receiver) of the sum over classes [-]
    skirt_radius_mm : (state,) border between top and skirt; 0 where untouched
    """

    flux: FloatArray
    standard_error: FloatArray
    skirt_radius_mm: FloatArray


def accuracy_of(accuracy: str | Accuracy) -> Accuracy:
    """Settings by name (draft, standard, fine) or as given."""
    if isinstance(accuracy, str):
        if accuracy not in ACCURACIES:
            raise InputError(f"accuracy: {accuracy!r}, must be one of {', '.join(ACCURACIES)}")
        return ACCURACIES[accuracy]
    if accuracy.replicates < 2:
        raise InputError(f"accuracy: {accuracy.replicates} replicates, needs 2 or more for a standard error")
    return accuracy


def trace_scene(
    scene: OpticalScene,
    centres_mm: FloatArray,
    indentations: Sequence[Indentation | None],
    *,
    accuracy: str | Accuracy = "standard",
    seed: int = 0,
    pairs: NDArray[np.bool_] | None = None,
    on_step: Callable[[int, int], None] | None = None,
) -> RawLight:
    """Trace a scene for a list of presses.

    Parameters
    ----------
    scene : walls, emitters, receivers and materials
    centres_mm : (state, 2) press axis; ignored where untouched [mm]
    indentations : one per state, None where untouched
    accuracy : draft, standard, fine, or settings
    seed : of all offsets; same seed, same bits, whatever the number of threads
    pairs : (emitter, receiver) or (state, emitter, receiver) mask; a pair left out is 0
    on_step : called with (states done, states)

    Raises
    ------
    InputError, ModelScopeError : see `sims.optics.checks` and `sims.optics.surface`.
    """
    settings = accuracy_of(accuracy)
    check_scene(scene)
    surfaces = stack_surfaces(indentations, np.asarray(centres_mm, dtype=np.float64), scene)
    states = len(indentations)
    wanted = wanted_pairs(pairs, states, len(scene.emitter_wall), len(scene.receiver_wall))
    untouched = _remembered(scene, settings, seed)
    shape = (len(CLASS_NAMES), *wanted.shape)
    flux, error = np.zeros(shape), np.zeros(wanted.shape)
    for start in range(0, states, BATCH_STATES):
        part = slice(start, min(start + BATCH_STATES, states))
        values = _trace_batch(wanted[part], surfaces, part, untouched, settings)
        flux[:, part] = values.mean(axis=1).transpose(1, 0, 2, 3)
        totals = values.sum(axis=2)
        error[part] = totals.std(axis=1, ddof=1) / np.sqrt(settings.replicates)
        if on_step is not None:
            on_step(part.stop, states)
    active = surfaces.press[:, SKIRT_R]
    return RawLight(flux=flux, standard_error=error, skirt_radius_mm=active.copy())


@dataclass(frozen=True, kw_only=True)
class _Untouched:
    """What a scene and a seed fix once: packed patches, untouched flux, point sets."""

    box: FloatArray
    emitters: FloatArray
    receivers: FloatArray
    flat: FloatArray
    flat_diffuse: FloatArray
    flat_join: FloatArray
    scale: FloatArray
    points: FloatArray
    shifts: FloatArray
    layout: NDArray[np.int64]
    areas: FloatArray
    reflectances: FloatArray


def _packed(scene: OpticalScene) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Box (5,), emitters (e, 7) and receivers (r, 7), clipped to the clear layer."""
    box = np.array(
        [scene.length_mm, scene.width_mm, scene.height_mm, scene.refractive_index, scene.absorption_per_mm]
    )
    ones = np.ones(len(scene.receiver_wall))
    emitters = _clipped(scene.emitter_wall, scene.emitter_patch, scene.emitter_order, scene.height_mm)
    receivers = _clipped(scene.receiver_wall, scene.receiver_patch, ones, scene.height_mm)
    receivers[:, 6] = 4 * receivers[:, 3] * receivers[:, 4]
    return box, emitters, receivers


def _clipped(walls: NDArray[np.int64], patches: FloatArray, orders: FloatArray, height: float) -> FloatArray:
    low = np.clip(patches[:, 1] - patches[:, 3], 0.0, height)
    high = np.clip(patches[:, 1] + patches[:, 3], 0.0, height)
    full_area = 4 * patches[:, 2] * patches[:, 3]
    return np.column_stack(
        [walls, patches[:, 0], (low + high) / 2, patches[:, 2], (high - low) / 2, orders, full_area]
    ).astype(np.float64)


_REMEMBERED: dict[str, _Untouched] = {}
"""Untouched pads of this process by content; each is a pure function of its key."""
REMEMBERED_PADS = 8


def _remembered(scene: OpticalScene, settings: Accuracy, seed: int) -> _Untouched:
    fields = (getattr(scene, field.name) for field in dataclass_fields(scene))
    content = "|".join(np.asarray(value, dtype=np.float64).tobytes().hex() for value in fields)
    key = f"{content}|{settings}|{seed}"
    if key not in _REMEMBERED:
        if len(_REMEMBERED) >= REMEMBERED_PADS:
            _REMEMBERED.pop(next(iter(_REMEMBERED)))
        _REMEMBERED[key] = _untouched(scene, settings, seed)
    return _REMEMBERED[key]


def _untouched(scene: OpticalScene, settings: Accuracy, seed: int) -> _Untouched:
    from scipy.stats import qmc

    from sims.optics import compiled

    box, emitters, receivers = _packed(scene)
    nodes, weights = _gauss(settings.flat_nodes)
    flat = compiled.flat_matrix(emitters, receivers, box, nodes, weights)
    largest = max(settings.reference_rays, settings.diffuse_rays, 1024)
    points = qmc.Sobol(4, scramble=True, rng=POINT_SEED).random(largest)
    shifts = np.random.default_rng(seed).random((settings.replicates, 6))
    walls_bottom = [scene.wall_reflectance] * 4 + [scene.bottom_reflectance, scene.tip_reflectance]
    reflectances = np.array(walls_bottom)
    layout = compiled.patch_layout(box, REFERENCE_PATCH_MM)
    areas = compiled.patch_areas(layout, receivers, box)
    parts = (box, emitters, receivers, points, reflectances)
    flat_join = np.stack(
        [_joined(parts, shift[2:6], settings.diffuse_rays, layout, areas) for shift in shifts]
    )
    flat_diffuse = _joined(parts, np.zeros(4), settings.reference_rays, layout, areas)
    flat_diffuse = flat_diffuse * _higher_orders(parts, settings)
    total = flat.sum(axis=0)
    scale = np.where(total > 0, total, total[total > 0].mean() if (total > 0).any() else 1e-3)
    return _Untouched(
        box=box, emitters=emitters, receivers=receivers, flat=flat, flat_diffuse=flat_diffuse,
        flat_join=flat_join, scale=scale, points=points, shifts=shifts, layout=layout, areas=areas,
        reflectances=reflectances,
    )  # fmt: skip


_Parts = tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]


def _no_press(box: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    from sims.optics.surface import CELLS, COLUMNS, HIGHEST, LOWEST, TOP

    press = np.zeros(COLUMNS)
    press[[TOP, LOWEST, HIGHEST]] = box[2]
    return press, np.zeros((CELLS, 4)), np.zeros((2, CELLS + 1))


def _deposits(
    parts: _Parts, shift: FloatArray, count: int, layout: NDArray[np.int64]
) -> tuple[FloatArray, FloatArray]:
    from sims.optics import compiled

    box, emitters, receivers, points, _ = parts
    top = _no_press(box)
    first_e, first_r = compiled.EMITTER_SEQUENCE, compiled.RECEIVER_SEQUENCE
    return (
        compiled.untouched_deposits(emitters, receivers, box, *top, points, count, shift, first_e, layout),
        compiled.untouched_deposits(receivers, receivers, box, *top, points, count, shift, first_r, layout),
    )


def _joined(
    parts: _Parts, shift: FloatArray, count: int, layout: NDArray[np.int64], areas: FloatArray
) -> FloatArray:
    """(emitter, receiver) once-scattered flux of the untouched pad."""
    given, taken = _deposits(parts, shift, count, layout)
    return _couple(given, taken, parts, layout, areas)


def _couple(
    given: FloatArray, taken: FloatArray, parts: _Parts, layout: NDArray[np.int64], areas: FloatArray
) -> FloatArray:
    _, _, receivers, _, reflectances = parts
    per_patch = np.repeat(reflectances, layout[:, 0] * layout[:, 1])
    share = np.divide(per_patch, areas, out=np.zeros_like(areas), where=areas > 1e-9)
    return np.asarray((given * share) @ taken.T * (4 * receivers[:, 3] * receivers[:, 4]))


def _higher_orders(parts: _Parts, settings: Accuracy) -> FloatArray:
    """(emitter, receiver) all scattered orders over the first, untouched pad."""
    from sims.optics import compiled

    box, _, receivers, points, reflectances = parts
    surface = 2 * (box[0] + box[1]) * box[2] + box[0] * box[1]
    layout = compiled.patch_layout(box, max(2.0, float(np.sqrt(surface / RADIOSITY_PATCHES))))
    areas = compiled.patch_areas(layout, receivers, box)
    given, taken = _deposits(parts, np.zeros(4), min(settings.reference_rays, 4096), layout)
    matrix = compiled.bounce_matrix(layout, receivers, box, *_no_press(box), points, 128)
    patches = len(matrix)
    per_patch = np.repeat(reflectances, layout[:, 0] * layout[:, 1])[:patches]
    system = np.eye(patches) - (per_patch[:, None] * matrix).T
    every = given.copy()
    every[:, :patches] = np.linalg.solve(system, given[:, :patches].T).T
    first = _couple(given, taken, parts, layout, areas)
    total = _couple(every, taken, parts, layout, areas)
    return np.divide(total, first, out=np.ones_like(first), where=first > 0)


def _gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre nodes and weights on 0..1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


def _trace_batch(
    wanted: NDArray[np.bool_], surfaces: SurfaceStack, part: slice, fixed: _Untouched, settings: Accuracy
) -> FloatArray:
    from sims.optics.compiled import trace_states

    rules = (
        *_gauss(settings.nodes_emitter),
        *_gauss(settings.nodes_column),
        *_gauss(settings.nodes_height),
    )
    numbers = np.array(
        [
            settings.rings, settings.sectors, settings.cell_tolerance, settings.cell_share,
            settings.chain_rings, settings.chain_sectors, settings.chain_share, settings.calm_share,
        ],
        dtype=np.float64,
    )  # fmt: skip
    return np.asarray(
        trace_states(
            wanted, fixed.emitters, fixed.receivers, fixed.box, surfaces.press[part], surfaces.cubic[part],
            surfaces.steepest[part], surfaces.bends[part], fixed.flat, fixed.flat_diffuse, fixed.flat_join,
            fixed.scale, rules, (*_gauss(settings.mirror_emitter), *_gauss(settings.mirror_receiver)),
            fixed.points, settings.diffuse_rays, fixed.shifts, fixed.layout, fixed.areas,
            fixed.reflectances, numbers,
        )
    )  # fmt: skip
