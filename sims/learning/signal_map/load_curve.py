"""The force that goes with a depth, for a model's header: the contact model's load of the centred press.

Left out: nearer walls raise the force by up to a tenth at 1 mm (docs/understand/model.md); the band of the modulus;
viscosity.
"""

from __future__ import annotations

from design.spec import SensorDesign
from sims.contact.force_curve import force_curve
from sims.contact.indentation import solved_press
from sims.learning.inference.header import ForceCurve
from sims.press.depths import COARSE_STEP_MM, depth_schedule_mm


def load_curve(design: SensorDesign) -> ForceCurve:
    """Force against depth to the design's deepest press.

    Raises
    ------
    ModelScopeError : deeper than the contact model goes.
    """
    deepest = design.operating.max_depth_mm
    found = force_curve(design, solved_press(design, deepest), depth_schedule_mm(deepest, COARSE_STEP_MM))
    return ForceCurve(
        depth_mm=tuple(float(depth) for depth in found.depth_mm),
        force_n=tuple(float(force) for force in found.force_n),
    )
