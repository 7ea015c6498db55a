"""The pressed tops that the light model traces, for the oracle and for tests of the surfaces themselves."""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.arrays import FloatArray
from optopad.design.spec import SensorDesign
from optopad.sims.optics import tracing
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import SmoothField
from optopad.sims.optics.scene.symmetry import StateClasses, each_its_own
from optopad.sims.press import Indentation


@dataclass(frozen=True, kw_only=True)
class PressedTops:
    """The pressed tops for a list of states, as the light trace takes them.

    Attributes
    ----------
    classes : groups of states with equal light, by symmetry; the other attributes have one entry per group
    near : for each group, the surface curve around the tip's axis; None if untouched
    fields : for each group, the smooth height that is added to the curve; None if nothing is added
    """

    classes: StateClasses
    near: list[Indentation | None]
    fields: list[SmoothField | None]


def pressed_tops(design: SensorDesign, presses: FloatArray, *, by_symmetry: bool = True) -> PressedTops:
    """Pressed surfaces for a list of presses, computed by the contact model at each location.

    Parameters
    ----------
    presses : (state, 3) as for `optopad.sims.optics.tracing.trace`
    by_symmetry : whether states that are equal by a symmetry of the layout share one top; if False, each has its own
    """
    tips, scene = tracing._tips(presses), scene_of(design)
    classes = tracing._classes(scene, tips) if by_symmetry else each_its_own(scene, len(tips))
    near, fields = tracing._made(design, scene, tips[classes.first, 0])
    return PressedTops(classes=classes, near=near, fields=fields)
