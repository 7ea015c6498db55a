"""Drawings of a page that do not depend on the tolerance of a verdict."""

from __future__ import annotations

from dataclasses import dataclass

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.spec import SensorDesign
from optopad.report.scenes.map_scene import MapScene
from optopad.report.scenes.ray_scene import RayScene, ray_scene
from optopad.report.sections.drawings import Drawing, drawings_without_tolerance
from optopad.report.sections.maps import map_scene
from optopad.sims.score.result import ContinuityScore
from optopad.work import beside


@dataclass(frozen=True, kw_only=True)
class EarlyDrawings:
    """Drawings of a score.

    Attributes
    ----------
    drawings : plots; the key is the file's stem without the prefix
    maps : maps of the pad by depth; None if the score has no map
    light : paths of light, or a text that says why there are none; None if there is no verdict
    """

    drawings: dict[str, Drawing]
    maps: MapScene | None
    light: RayScene | str | None


def early_drawings(design: SensorDesign, score: ContinuityScore, *, seed: int) -> EarlyDrawings:
    """All drawings that a score has data for, except those of its tolerance.

    Parameters
    ----------
    seed : seed of the random paths of light
    """
    with beside(lambda: _light(design, score, seed)) as light:
        maps = map_scene(design, score)
        drawings = drawings_without_tolerance(design, score, maps)
    return EarlyDrawings(drawings=drawings, maps=maps, light=light())


def _light(design: SensorDesign, score: ContinuityScore, seed: int) -> RayScene | str | None:
    """The view of the light; a text with the reason if the ray tracer refuses the design; None without a verdict."""
    try:
        return ray_scene(design, score, seed=seed)
    except (InputError, ModelScopeError) as err:
        return f"No picture: the ray tracer refuses this design. {err}"
