"""Trace every pair of a disc or crowned pad, untouched or pressed: flux by path class, with a standard error.

Method, class by class
----------------------
- `direct`: quadrature with a horizon for every column (`formed_direct`).
- `top`, `skirt`: pencils through points of the top (`formed_mirrored`). The untouched pad is traced once, finely. A
  press changes it by what the same points bring with and without it: a grid outside the dimple's circle, rings within.
- `diffuse`: the untouched pad's light of all orders, once, times how the press changes what is scattered once
  (`formed_deposits`).

Replicates with other offsets give the standard error. Classes, flux and errors are those of
`sims.optics.engine.trace_states`, whose light of flat rectangles is finer for its cost.

Left out: smooth walls, several tips, fields, folds; `sims.optics.oracle` has all of these.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from design.errors import InputError, ModelScopeError
from sims.optics.accuracy import Accuracy
from sims.optics.engine.formed.formed_lower import formed_top, walls_of, windows_of
from sims.optics.engine.formed.formed_patches import PatchLayout, is_in_plan, patch_layout
from sims.optics.engine.formed.formed_scattered import DIMENSIONS
from sims.optics.engine.formed.formed_top import CONTACT_EDGE, DEPTH, OUTER, SKIRT_EDGE, FormedTop, empty_rows
from sims.optics.engine.threads import run_each
from sims.optics.scene.optical_scene import FloatArray, OpticalScene
from sims.press.indentation import Indentation

CLASSES = 5
GRID_PER_IMAGE_STEP = 1.4
"""Pitch of the grid outside the dimple, over the images' step of the same accuracy [mm]."""
REFERENCE_MM, REFERENCE_PARTS = 0.15, 3
"""Grid and parts of the untouched pad."""
REFERENCE_RAYS = 65536
DEPOSIT_RAYS = 2048


@dataclass(frozen=True, kw_only=True)
class FormedPad:
    """What every state of a pad shares.

    Attributes
    ----------
    emitters, receivers : window rows; walls, round_wall : as kernels read them
    patches : layout of patches, and their weights rho / A [1/mm2]
    direct, mirrored, diffuse : untouched light: (e, r), (replicate, 2, e, r), (replicate, e, r)
    """

    scene: OpticalScene
    emitters: FloatArray
    receivers: FloatArray
    walls: FloatArray
    round_wall: FloatArray
    patches: PatchLayout
    direct: FloatArray
    mirrored: FloatArray
    diffuse: FloatArray


def trace_formed(
    scene: OpticalScene,
    centres_mm: FloatArray,
    indentations: Sequence[object],
    settings: Accuracy,
    seed: int,
    wanted: NDArray[np.bool_],
    on_step: Callable[[int, int], None] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Light of every state and pair.

    Parameters
    ----------
    scene : with a form
    centres_mm : (state, 2) where the tip goes in, in plan [mm]
    indentations : one a state, None where untouched; heights above the untouched top, along its normal
    wanted : (state, emitter, receiver) pairs; others are 0

    Returns
    -------
    (state, replicate, class, emitter, receiver) flux over emitted power; (emitter, receiver) untouched flux, above 0

    Raises
    ------
    InputError : a scene without a form, or with smooth walls.
    ModelScopeError : a press that is not a single tip.
    """
    if scene.form is None:
        raise InputError("form: a flat rectangle is traced by sims.optics.engine.trace_states")
    if scene.wall_index is not None:
        raise InputError("wall_index: smooth walls of discs and crowned pads are traced by the oracle alone")
    presses = [_single(press) for press in indentations]
    pad = formed_pad(scene, settings, seed)
    out = np.zeros((len(presses), settings.replicates, CLASSES, *wanted.shape[1:]))
    done, told = [0], threading.Lock()

    def trace_one(state: int) -> None:
        press = presses[state]
        if press is not None and press.depth_mm > 0.0:
            out[state] = _pressed(
                pad, np.asarray(centres_mm[state]).reshape(2), press, settings, seed, wanted[state]
            )
        else:
            out[state] = _untouched(pad)
        with told:
            done[0] += 1
            if on_step is not None:
                on_step(done[0], len(presses))

    run_each(trace_one, len(presses))
    untouched = _untouched(pad).mean(axis=0).sum(axis=0)
    least = untouched[untouched > 0.0].min(initial=1.0)
    return np.where(wanted[:, None, None], out, 0.0), np.maximum(untouched, least)


def _single(press: object) -> Indentation | None:
    """A state's one press, alone or in a list."""
    listed = list(press) if isinstance(press, Sequence) else [press]
    if len(listed) != 1 or not (listed[0] is None or isinstance(listed[0], Indentation)):
        raise ModelScopeError("indentations: on a disc or a crown one tip alone is traced; press with one")
    return listed[0]


def formed_pad(scene: OpticalScene, settings: Accuracy, seed: int) -> FormedPad:
    """The untouched light of a scene, remembered."""
    return _remembered(_Key(scene), settings.replicates, seed)


class _Key:
    """A scene as a key: equal content, equal key."""

    def __init__(self, scene: OpticalScene) -> None:
        self.scene = scene
        self._text = repr(
            [
                value.tolist() if isinstance(value, np.ndarray) else value
                for value in (getattr(scene, name) for name in scene.__dataclass_fields__)
            ]
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self._text == other._text

    def __hash__(self) -> int:
        return hash(self._text)


@lru_cache(maxsize=4)
def _remembered(key: _Key, replicates: int, seed: int) -> FormedPad:
    from sims.optics.engine.formed.formed_kernels import (
        mirrored_matrix,
        points_on,
        scattered_matrix,
        straight_matrix,
    )

    scene = key.scene
    emitters, receivers = windows_of(scene, "emitter"), windows_of(scene, "receiver")
    walls, round_wall = walls_of(scene)
    top = formed_top(scene, np.zeros(2), None)
    every = np.ones((len(emitters), len(receivers)), dtype=np.bool_)
    shifts = np.random.default_rng(seed).random((replicates, DIMENSIONS))
    mirrored = np.zeros((replicates, 2, len(emitters), len(receivers)))

    def one(number: int) -> None:
        at, element = _grid(scene, top, walls, round_wall, REFERENCE_MM, shifts[number, :2])
        points = points_on(at, element, *top)
        mirrored[number] = mirrored_matrix(
            emitters, receivers, every, points, REFERENCE_PARTS, scene.absorption_per_mm, scene.refractive_index,
            walls, round_wall, *top,
        )  # fmt: skip

    run_each(one, replicates)
    diffuse = np.zeros((replicates, len(emitters), len(receivers)))

    def scatter(number: int) -> None:
        diffuse[number] = scattered_matrix(
            emitters, receivers, REFERENCE_RAYS // replicates, sequence_steps(), shifts[number],
            scene.absorption_per_mm, scene.refractive_index, _reflectances(scene), walls, round_wall, *top,
        )  # fmt: skip

    run_each(scatter, replicates)
    return FormedPad(
        scene=scene,
        emitters=emitters,
        receivers=receivers,
        walls=walls,
        round_wall=round_wall,
        patches=patch_layout(scene, walls, round_wall),
        direct=straight_matrix(
            emitters, receivers, every, scene.absorption_per_mm, *top, *_straight_rules(6, 6, 6)
        ),
        mirrored=mirrored,
        diffuse=diffuse,
    )


def _untouched(pad: FormedPad) -> FloatArray:
    out = np.zeros((len(pad.mirrored), CLASSES, *pad.direct.shape))
    out[:, 0], out[:, 1:3], out[:, 4] = pad.direct, pad.mirrored, pad.diffuse
    return out


def _pressed(
    pad: FormedPad,
    centre_mm: FloatArray,
    press: Indentation,
    settings: Accuracy,
    seed: int,
    wanted: NDArray[np.bool_],
) -> FloatArray:
    """(replicate, class, emitter, receiver) light of one state."""
    from sims.optics.engine.formed.formed_kernels import straight_matrix

    scene = pad.scene
    top = formed_top(scene, centre_mm, press)
    flat = _without_press(top)
    out = _untouched(pad)
    rules = _straight_rules(settings.nodes_emitter, settings.nodes_column, settings.nodes_height)
    out[:, 0] = straight_matrix(pad.emitters, pad.receivers, wanted, scene.absorption_per_mm, *top, *rules)
    random = np.random.default_rng((seed, 1))
    first = random.random(2)
    for number in range(settings.replicates):
        shift = (first + number / settings.replicates) % 1.0
        now, before = _mirrored(pad, top, flat, settings, shift, wanted)
        out[number, 2] += now[1] - before[1]
        out[number, 1] += now[0] - before[0]
        out[number, 4] *= _scattered_ratio(pad, top, flat, random.random(DIMENSIONS))
    out[:, 1:3] = np.where(out[:, 1:3] > 0.0, out[:, 1:3], 0.0)
    return out


def _mirrored(
    pad: FormedPad,
    top: FormedTop,
    flat: FormedTop,
    settings: Accuracy,
    shift: FloatArray,
    wanted: NDArray[np.bool_],
) -> tuple[FloatArray, FloatArray]:
    """Mirrored light of the same points with and without the press."""
    from sims.optics.engine.formed.formed_kernels import mirrored_matrix, points_on

    scene, parts = pad.scene, 2 if settings.image_step > 0.3 else 3
    outer = top.numbers[OUTER]
    pitch = GRID_PER_IMAGE_STEP * settings.image_step
    at, element = _grid(scene, top, pad.walls, pad.round_wall, pitch, shift)
    far = (at**2).sum(axis=1) >= outer**2
    rings, elements = _rings(top.numbers[CONTACT_EDGE], outer, settings, shift)
    found = []
    for one in (top, flat):
        near = points_on(rings, elements, *one)
        inside = is_in_plan(near[:, 0], near[:, 1], pad.walls, pad.round_wall)
        points = np.vstack([points_on(at[far], element[far], *one), near[inside]])
        found.append(
            mirrored_matrix(
                pad.emitters, pad.receivers, wanted, points, parts, scene.absorption_per_mm, scene.refractive_index,
                pad.walls, pad.round_wall, *one,
            )
        )  # fmt: skip
    return found[0], found[1]


def _scattered_ratio(pad: FormedPad, top: FormedTop, flat: FormedTop, shift: FloatArray) -> FloatArray:
    """(emitter, receiver) once-scattered light with the press over that without."""
    from sims.optics.engine.formed.formed_kernels import deposit_matrix

    scene, patches = pad.scene, pad.patches
    joins = []
    for one in (top, flat):
        weight = patches.weight.copy()
        edge = one.numbers[CONTACT_EDGE]
        weight[-1] = scene.tip_reflectance / (np.pi * edge**2) if edge > 0.0 else 0.0
        given, taken = (
            deposit_matrix(
                windows, pad.receivers, DEPOSIT_RAYS, sequence_steps(), shift + 0.25 * k, scene.absorption_per_mm,
                scene.refractive_index, pad.walls, pad.round_wall, *one, patches.numbers, len(weight),
            )
            for k, windows in enumerate((pad.emitters, pad.receivers))
        )  # fmt: skip
        joins.append((given * weight) @ taken.T)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(joins[1] > 0.0, joins[0] / joins[1], 1.0))


def _without_press(top: FormedTop) -> FormedTop:
    """The untouched top in the frame of a press."""
    numbers = top.numbers.copy()
    numbers[[DEPTH, OUTER, CONTACT_EDGE, SKIRT_EDGE]] = 0.0
    return top._replace(numbers=numbers, rows=empty_rows())


def _grid(
    scene: OpticalScene,
    top: FormedTop,
    walls: FloatArray,
    round_wall: FloatArray,
    pitch_mm: float,
    shift: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """(n, 2) places of a grid of the pad's plan, in the plan of a frame, and their elements there [mm2]."""
    form = scene.form
    assert form is not None
    xs = (np.arange(-1, scene.length_mm / pitch_mm + 1) + shift[0]) * pitch_mm
    ys = (np.arange(-1, scene.width_mm / pitch_mm + 1) + shift[1]) * pitch_mm
    x, y = (axis.ravel() for axis in np.meshgrid(xs, ys, indexing="ij"))
    inside = is_in_plan(x, y, walls, round_wall)
    x, y = x[inside], y[inside]
    place = np.column_stack([x, y, form.top_mm(x, y, scene.height_mm)]) - top.origin
    normal = form.normal(x, y)
    element = pitch_mm**2 * (normal @ top.axes[2]) / normal[:, 2]
    return np.ascontiguousarray((place @ top.axes.T)[:, :2]), np.ascontiguousarray(element)


def _rings(
    contact_mm: float, outer_mm: float, settings: Accuracy, shift: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(n, 2) places on rings around the press, closer beside the contact, and their elements [mm2]."""
    within, beyond = max(settings.rings // 3, 4), settings.rings
    share = np.arange(beyond + 1) / beyond
    edges = np.concatenate(
        [
            contact_mm * np.sqrt(np.arange(within) / within),
            contact_mm + (outer_mm - contact_mm) * (0.25 * share + 0.75 * share**2),
        ]
    )
    low, high = edges[:-1, None], edges[1:, None]
    count = settings.columns
    radius = np.sqrt(low**2 + shift[0] * (high**2 - low**2))
    turn = 2.0 * np.pi * (np.arange(count) + shift[1] + 0.618034 * np.arange(len(low))[:, None]) / count
    at = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=-1).reshape(-1, 2)
    element = np.repeat((np.pi * (high**2 - low**2) / count).ravel(), count)
    return at, element


def _straight_rules(emitter: int, column: int, height: int) -> tuple[FloatArray, ...]:
    rules = [np.polynomial.legendre.leggauss(count) for count in (emitter, column, height)]
    return tuple(part for rule in rules for part in rule)


def sequence_steps() -> FloatArray:
    """(DIMENSIONS,) steps of Roberts' additive sequence: powers of the root of x^(d + 1) = x + 1."""
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (DIMENSIONS + 1))
    return np.asarray((1.0 / root) ** np.arange(1, DIMENSIONS + 1))


def _reflectances(scene: OpticalScene) -> FloatArray:
    return np.array([scene.wall_reflectance, scene.bottom_reflectance, scene.tip_reflectance])
