"""Drawings of a page that do not depend on the tolerance of a verdict."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.scenes.map_scene import MapScene
from optopad.report.scenes.ray_scene import RayScene, ray_scene
from optopad.report.sections.drawings import Drawing, drawings_without_tolerance
from optopad.report.sections.maps import map_scene
from optopad.sims.readings.readout import save_dataset, signals_dataset
from optopad.sims.score.maps_file import maps_dataset
from optopad.sims.score.result import ContinuityScore


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
    maps = map_scene(design, score)
    drawings = drawings_without_tolerance(design, score, maps)
    return EarlyDrawings(drawings=drawings, maps=maps, light=_light(design, score, seed))


def write_early(
    design: SensorDesign, score: ContinuityScore, sims: Path, *, seed: int, with_page: bool
) -> bytes | None:
    """Write the data sets of a score, and make its early drawings if `with_page`; they are returned pickled."""
    if score.pad_signals is not None and score.readout is not None:
        gain = score.readout.counts_per_flux
        save_dataset(
            signals_dataset(score.pad_signals, cavity_of(design), counts_per_flux=gain), sims / "signals.nc"
        )
        save_dataset(maps_dataset(design, score), sims / "maps.nc")
    return pickle.dumps(early_drawings(design, score, seed=seed)) if with_page else None


def _light(design: SensorDesign, score: ContinuityScore, seed: int) -> RayScene | str | None:
    """The view of the light; a text with the reason if the ray tracer refuses the design; None without a verdict."""
    try:
        return ray_scene(design, score, seed=seed)
    except (InputError, ModelScopeError) as err:
        return f"No picture: the ray tracer refuses this design. {err}"
