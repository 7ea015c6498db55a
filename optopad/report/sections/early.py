"""Drawings of a page that do not depend on the tolerance of a verdict."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from optopad.design.errors import InputError, ModelScopeError
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.report.scenes.map_scene import MapScene
from optopad.report.scenes.ray_scene import RayScene, ray_scene
from optopad.report.sections.drawings import PREFIX, Drawing, drawings_without_tolerance, tolerance_drawings
from optopad.report.sections.maps import map_scene
from optopad.report.sections.rays import sheet_of
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.paths import LightWalker
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.readings.readout import save_dataset, signals_dataset
from optopad.sims.score.maps_file import maps_dataset
from optopad.sims.score.result import ContinuityScore
from optopad.sims.verdict.figure_errors import place_force


@dataclass(frozen=True, kw_only=True)
class EarlyDrawings:
    """Drawings of a score.

    Attributes
    ----------
    drawings : plots; the key is the file's stem without the prefix
    maps : maps of the pad by depth; None if the score has no map
    light : paths of light, or a text that says why there are none; None if there is no verdict
    sheet : their picture for print; None if there are none
    """

    drawings: dict[str, Drawing]
    maps: MapScene | None
    light: RayScene | str | None
    sheet: Drawing | None


def early_drawings(
    design: SensorDesign, score: ContinuityScore, *, seed: int, done: Mapping[str, str] | None = None
) -> EarlyDrawings:
    """All drawings that a score has data for, except those of its tolerance.

    Parameters
    ----------
    seed : seed of the random paths of light
    done : SVG texts of plots that are there already, by name
    """
    maps = map_scene(design, score)
    drawings = drawings_without_tolerance(design, score, maps, done)
    light = _light(design, score, seed)
    sheet = sheet_of(light) if isinstance(light, RayScene) else None
    return EarlyDrawings(drawings=drawings, maps=maps, light=light, sheet=sheet)


def prepare(design: SensorDesign) -> None:
    """Load and compute what drawings of the design need whatever its score is, while the score is computed."""
    middle_mm = design.cavity.length_mm / 2, design.cavity.width_mm / 2
    LightWalker(scene_of(design), middle_mm, None, 0).random_paths(0, count=1, most_rays=1)
    place_force(contact_of(design), middle_mm)


def write_early(
    design: SensorDesign,
    score: ContinuityScore,
    sims: Path,
    done: Sequence[Path],
    *,
    seed: int,
    with_page: bool,
) -> bytes | None:
    """Write the data sets of a score, and make its early drawings if `with_page`; they are returned pickled.

    Parameters
    ----------
    done : plots in the bundle that need not be drawn again
    """
    if score.pad_signals is not None and score.readout is not None:
        gain = score.readout.counts_per_flux
        save_dataset(
            signals_dataset(score.pad_signals, cavity_of(design), counts_per_flux=gain), sims / "signals.nc"
        )
        save_dataset(maps_dataset(design, score), sims / "maps.nc")
    if not with_page:
        return None
    texts = {file.stem.removeprefix(PREFIX): file.read_text(encoding="utf-8") for file in done}
    return pickle.dumps(early_drawings(design, score, seed=seed, done=texts))


def draw_tolerance(score: ContinuityScore) -> bytes:
    """The plots of a score's tolerance, pickled."""
    return pickle.dumps(tolerance_drawings(score))


def _light(design: SensorDesign, score: ContinuityScore, seed: int) -> RayScene | str | None:
    """The view of the light; a text with the reason if the ray tracer refuses the design; None without a verdict."""
    try:
        return ray_scene(design, score, seed=seed)
    except (InputError, ModelScopeError) as err:
        return f"No picture: the ray tracer refuses this design. {err}"
