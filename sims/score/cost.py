"""Estimates how long a score, a run or a quick prediction takes, before it begins.

Light takes almost all of the time. A *state* is a press at a location and a depth; states that are equal by symmetry of
the layout are traced once, and stored light costs nothing. All seconds are processor time of one core with compiled
kernels:

    stage = distinct states of the score's map x seconds of a state x `STAGES[stage]`

The time of a state follows from the shape: on a flat rectangle from the number of pairs, on other pads from the numbers
of emitters and of cells of the top. On three flat presets a total is 0.8 to 1.1 times the measured time.
"""

from __future__ import annotations

import os

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import DesignError, InputError, ModelScopeError
from optopad.design.press_protocol import QUICK_PROTOCOL, load_protocol_file
from optopad.design.shape.cavity import cavity_of, is_facing_rows
from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import is_in_library
from optopad.sims.contact.scope import contact_of, solved_depths
from optopad.sims.optics.accuracy import ACCURACIES, Accuracy
from optopad.sims.optics.engine.general.lower import windows_of
from optopad.sims.optics.engine.general.points import pitch_of
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.symmetry import state_classes
from optopad.sims.readings.press_data import knots_mm
from optopad.sims.score.judge import SETTINGS, Settings, settings_of
from optopad.sims.verdict.pad_map import grid_places_mm, map_grid_mm
from optopad.sims.verdict.presses import map_depths_mm

STAGES = {
    "rows": {"map": 1.05, "bounds": 2.0, "builds": 0.4},
    "rectangle": {"map": 1.05, "bounds": 2.2, "builds": 1.0},
    "round": {"map": 1.15, "bounds": 2.4, "builds": 2.6},
}
"""Time of a stage, relative to one trace of the map of `optopad score`, by shape: the map with its near presses, the
bounds, and both ends of all unmeasured parameters with a step of every field [-]. Of facing rows, the governing pair
alone is judged for these."""
FINE_BOUNDS = 1.3
"""Time of the bounds of a finer map, relative to one trace of it [-]."""
PAIR_S, TOP_S = 1.3e-3, 3e-4
"""Time of a pair in one state of a flat rectangle, and of its pressed top per area in squared tip radii [s]."""
CELL_S = {"flat": 1.4e-6, "cylinder": 0.86e-6, "sphere": 9.8e-6}
"""Time of a cell of the top for one emitter in one state of another pad, by shape of the top [s]. A sphere costs most,
since it mirrors most light more than once."""
EMITTER_S = 3e-3
"""Time of the scattered light of one emitter in one state of such a pad [s]."""
PART_S = 0.06
"""Time of the untouched light of one emitter or receiver [s]."""
LIVE_S = 27.0
"""Time to solve one depth of a press that the library does not have [s]: a flat punch of 2.5 mm in 6 mm."""
REST_S, RUN_S, PREDICTION_S = 16.0, 24.0, 8.0
"""Time without light of a score, the addition of a run, and the time without light of a quick prediction [s]."""
DRAFT = 0.65
"""Time of a state of a quick prediction, relative to `_state_s` [-]: measured 0.55 on `gripper-teensy` and 0.67 on
`fingertip-dome`."""
WORTH_SAYING_S = 20.0
"""No estimate is shown if it is less than this [s]."""


def score_cost(design: SensorDesign, *, fine: bool = False, full: bool = False) -> dict[str, float]:
    """Estimated processor time of the stages of a score [s]: contact, untouched, map, bounds, builds, rest."""
    scene = scene_of(design)
    shape = "rows" if is_facing_rows(cavity_of(design)) else "rectangle" if scene.form is None else "round"
    stages = STAGES[shape]
    once = _map_s(design, SETTINGS["score"])
    again = _map_s(design, settings_of(fine=fine, full=full)) if fine or full else 0.0
    return {
        "contact": _contact_s(design),
        "untouched": PART_S * (len(scene.emitter_wall) + len(scene.receiver_wall)),
        "map": stages["map"] * max(once, again),
        "bounds": max(stages["bounds"] * once, FINE_BOUNDS * again),
        "builds": stages["builds"] * once,
        "rest": REST_S,
    }


def score_sentence(design: SensorDesign, *, fine: bool, full: bool, is_run: bool) -> str:
    """Message on the expected time of a score or of a whole run; empty if the time is short."""
    row, cavity, cores = settings_of(fine=fine, full=full), cavity_of(design), os.cpu_count() or 1
    seconds = (sum(score_cost(design, fine=fine, full=full).values()) + (RUN_S if is_run else 0.0)) / cores
    if seconds < WORTH_SAYING_S:
        return ""
    presses = len(_places_mm(design, row)) * len(_depths_mm(design, row))
    pairs = len(cavity.emitters) * len(cavity.receivers)
    return (
        f"{'run' if is_run else 'score'}: {about(seconds)} ({presses} presses x {pairs} pairs of parts in the map); "
        "less where the light is known"
    )


def about(seconds: float) -> str:
    """An expected time as it is shown, for example "about 2 minutes on 2 cores"."""
    cores = os.cpu_count() or 1
    length = f"{seconds / 60:.0f} minutes" if seconds >= 90.0 else f"{max(round(seconds, -1), 10):.0f} s"
    return f"about {length} on {cores} core{'s' if cores > 1 else ''}"


def quick_prediction_s(design: SensorDesign) -> float | None:
    """Estimated time of `optopad predict --quick` on all cores [s]; None if its presses do not fit the design."""
    try:
        protocol = load_protocol_file(QUICK_PROTOCOL).fitted_to(design)
        knots = knots_mm(design, is_coarse=True, deepest_mm=protocol.deepest_mm)
        places_mm = np.unique(np.concatenate(protocol.places_mm(design)), axis=0)
        states = _distinct(design, places_mm) * (len(knots) - 1)
    except (DesignError, InputError, ModelScopeError):
        return None
    return (DRAFT * states * _state_s(design, ACCURACIES["draft"]) + PREDICTION_S) / (os.cpu_count() or 1)


def _map_s(design: SensorDesign, row: Settings) -> float:
    """Processor time of one trace of a map [s]."""
    return (
        _distinct(design, _places_mm(design, row)) * len(_depths_mm(design, row)) * _state_s(design, row.map)
    )


def _places_mm(design: SensorDesign, row: Settings) -> FloatArray:
    workspace = cavity_of(design).workspace
    return grid_places_mm(workspace, *map_grid_mm(cavity_of(design), row.map_places))


def _depths_mm(design: SensorDesign, row: Settings) -> FloatArray:
    return map_depths_mm(design.operating.max_depth_mm, row.map_step_mm)


def _distinct(design: SensorDesign, places_mm: FloatArray) -> int:
    """Number of locations in `places_mm` (n, 2); those that are equal by symmetry of the layout count once."""
    return len(state_classes(scene_of(design), places_mm[:, None, :], [[1.0]] * len(places_mm)).first)


def _state_s(design: SensorDesign, settings: Accuracy) -> float:
    """Processor time of one state with all pairs [s]."""
    scene = scene_of(design)
    emitters, area_mm2 = len(scene.emitter_wall), scene.length_mm * scene.width_mm
    if scene.form is None:
        pairs = emitters * len(scene.receiver_wall)
        return pairs * PAIR_S + TOP_S * area_mm2 / design.indenter.tip_radius_mm**2
    top = scene.form.top
    kind = "flat" if top.is_flat else "sphere" if top.straight is None else "cylinder"
    pitch_mm = pitch_of(settings, scene, windows_of(scene, "emitter"), windows_of(scene, "receiver"))
    return emitters * (CELL_S[kind] * area_mm2 / pitch_mm**2 + EMITTER_S)


def _contact_s(design: SensorDesign) -> float:
    """Processor time to solve the presses of a tip or layer that the library does not have [s]."""
    contact = contact_of(design)
    if not contact.draft.plan.top.is_flat or is_in_library(contact):
        return 0.0
    deepest = design.operating.max_depth_mm / contact.tip_radius_mm
    return LIVE_S * len(solved_depths(contact.layer, deepest))
