"""What light of one state costs, by kind of pad and settings [s of one core].

Measured with the presets, nothing stored, kernels compiled (`tests/bench`): flat rectangles by pairs, discs and crowned
pads by emitters and cells of the grid of the top. Good to a third.
"""

from __future__ import annotations

from sims.optics.accuracy import Accuracy
from sims.optics.engine.formed.formed_lower import windows_of
from sims.optics.engine.formed.formed_points import pitch_of
from sims.optics.scene.optical_scene import OpticalScene

CELL_S = {"flat": 0.70e-6, "cylinder": 0.43e-6, "sphere": 4.9e-6}
"""Of a cell of the grid, a replicate and an emitter, by the top: a sphere mirrors most light often [s]."""
DEPOSITS_S = 1.5e-3
"""Of a part's scattered light in a state [s]."""
REFERENCE_S = 0.06
"""Of a part's light in the untouched pad, with the rays of named settings [s]; with those of tried builds a fifth."""
PAIR_S, FINEST_S = 0.9e-3, 0.25e-3
"""Of a pair of a flat rectangle with coarse settings, and what a finer lattice of images adds, over its step [s]."""


def _cells(scene: OpticalScene, settings: Accuracy) -> float:
    """About how many cells the grid of a disc's or crowned pad's top has."""
    pitch = pitch_of(settings, windows_of(scene, "emitter"), windows_of(scene, "receiver"))
    return scene.length_mm * scene.width_mm / pitch**2


def emitter_cost_s(scene: OpticalScene, settings: Accuracy, emitters: int) -> float:
    """Of a state in which some emitters are traced, each with one pair."""
    if scene.form is None:
        return emitters * pair_cost_s(scene, settings)
    top = scene.form.top
    kind = "flat" if top.is_flat else "sphere" if top.straight is None else "cylinder"
    of_cells = CELL_S[kind] * settings.replicates * _cells(scene, settings)
    return emitters * (of_cells + 2.0 * DEPOSITS_S)


def pair_cost_s(_scene: OpticalScene, settings: Accuracy) -> float:
    """Of a pair of a flat rectangle in a state."""
    return PAIR_S + FINEST_S / settings.image_step


def state_cost_s(scene: OpticalScene, settings: Accuracy) -> float:
    """Of a state with all pairs."""
    if scene.form is None:
        return len(scene.emitter_wall) * len(scene.receiver_wall) * pair_cost_s(scene, settings)
    return emitter_cost_s(scene, settings, len(scene.emitter_wall))


def untouched_cost_s(scene: OpticalScene, settings: Accuracy) -> float:
    """Of the untouched pad, before the first state."""
    parts = len(scene.emitter_wall) + len(scene.receiver_wall)
    return parts * REFERENCE_S * (1.0 if settings.reference_rays > 8192 else 0.2)
