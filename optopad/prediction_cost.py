"""Estimates the time of `optopad predict --quick`, without importing the libraries of the prediction itself.

Almost all of the time is light tracing. Locations that a symmetry of the layout maps onto each other are traced once.
On two cores shared with other work, one press took 122 ms of processor time on `fingertip-16` (64 pairs), 46 ms on a
ring of 4 + 4 parts (16 pairs), and 129 ms on the paper's pad (64 pairs). The constants below are a sixth lower, for an
idle machine. The remaining time is for training (0.3 to 5 s), the test, and the pictures.
"""

from __future__ import annotations

import os

import numpy as np

from optopad.design.errors import DesignError, InputError, ModelScopeError
from optopad.design.press_protocol import load_protocol_file
from optopad.design.spec import SensorDesign

STEM = "prediction"
"""File name, without suffix, of the results of `optopad predict` in a bundle's ``sims`` folder."""
QUICK_PROTOCOL = "piacenza2017-quick"
PRESS_S, PAIR_S = 14e-3, 1.4e-3
"""Processor time to trace the light of one press: a fixed part, and a part per pair [s]."""
LEFT_S = 8.0
"""Processor time of a quick prediction without light tracing [s]."""


def quick_prediction_s(design: SensorDesign) -> float | None:
    """Estimated time of `optopad predict DESIGN --quick` on all cores of this machine [s].

    The estimate assumes that no light is stored. It is None if the protocol's presses do not fit the design.
    """
    from optopad.sims.optics.scene.lower import scene_of
    from optopad.sims.optics.scene.symmetry import state_classes
    from optopad.sims.readings.press_data import knots_mm

    try:
        protocol = load_protocol_file(QUICK_PROTOCOL).fitted_to(design)
        places = np.unique(np.concatenate(protocol.places_mm(design)), axis=0)
        knots = knots_mm(design, is_coarse=True, deepest_mm=protocol.deepest_mm)
        scene = scene_of(design)
    except (DesignError, InputError, ModelScopeError):
        return None
    distinct = len(state_classes(scene, places[:, None, :], [[1.0]] * len(places)).first)
    pairs = len(scene.emitter_wall) * len(scene.receiver_wall)
    core_s = distinct * (len(knots) - 1) * (PRESS_S + pairs * PAIR_S) + LEFT_S
    return core_s / (os.cpu_count() or 1)
