"""How finely a design is judged: a row of settings for each use, from a layout that is being moved to a fine score.

| row    | for                                     | time on a pad of 48 pairs, two cores   |
|--------|-----------------------------------------|----------------------------------------|
| draft  | what is being moved about by hand       | one to six seconds, bounds two to ten  |
| search | designs of a search, base included      | two to eight seconds                   |
| score  | `optopad score`                         | ten to forty seconds                   |
| full   | the same, the map at 11 places a side   | minutes                                |
| fine   | the same with finer light, more bounds  | minutes                                |

How far the figures of a search are from those of a score is measured in docs/validation/search.md. Designs of a search
are judged alike, so their order suffers less than the figures do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from sims.bounds.defaults import COARSE_DEPTHS_MM, FINE_DEPTHS_MM
from sims.bounds.observability import BOUND_ACCURACIES
from sims.optics.accuracy import ACCURACIES, Accuracy
from sims.press.depths import COARSE_STEP_MM, STEP_MM
from sims.verdict.pad_map import COARSE_PLACES, FINE_PLACES
from sims.verdict.presses import DOUBT_ACCURACIES, MAP_ACCURACY, NEAR_ACCURACY, PAIR_ACCURACY

NEAR_TIPS = 4.0
"""Pairs whose chord is farther from a place are left as untouched there by a draft [tip radii]: on the paper's pad 28
of 48 are nearer. Margins of up to 20 noise units then differ by 0.3 from those of all, larger ones by up to 7."""
HALF_OF_DEPTH = 0.5


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How finely designs are judged.

    Attributes
    ----------
    untouched, pairs, map, bounds : settings of the light
    near : settings of the map's light near contact, where the map then has all depths; None: as the rest of it
    step_mm, map_step_mm : of the depths of pairs and of the map [mm]
    map_places, bound_places : places along the longer side of the workspace [-]
    bound_depths_mm : depths of the bounds; the end of the range of use is added [mm]
    bound_depth_share : share of the deepest press that these depths are limited to [-]
    near_tips : pairs of the map farther from a press are taken as untouched there [tip radii]; None traces all
    settled : places of the map that are traced again: those that the light's own error leaves open, by two independent
        traces; those close to the threshold, by a finer one; or none
    doubts : settings of these traces, tried in turn
    has_felt, has_losses : whether bounds come with the lightest press felt, and with what is lost with each part
    """

    untouched: str | Accuracy
    pairs: str | Accuracy
    map: Accuracy
    near: Accuracy | None
    bounds: tuple[Accuracy | str, ...]
    step_mm: float
    map_step_mm: float
    map_places: int
    bound_places: int
    bound_depths_mm: tuple[float, ...]
    bound_depth_share: float = 1.0
    near_tips: float | None = None
    settled: Literal["open", "close", "none"] = "none"
    doubts: tuple[Accuracy, ...] = ()
    has_felt: bool = False
    has_losses: bool = False


_QUICK = replace(ACCURACIES["draft"], reference_rays=4096)

_DRAFT_MAP = replace(
    ACCURACIES["score"],
    reference_rays=4096,
    rings=12,
    columns=30,
    top_rings=8,
    top_columns=20,
    repeat_share=0.2,
    image_step=0.7,
    ray_share=1.0,
)
"""A third of the time a state of a search's; 1 % rms of the untouched signal, most of it common to all depths."""

_SCORE = Settings(
    untouched="standard",
    pairs=PAIR_ACCURACY,
    map=MAP_ACCURACY,
    near=NEAR_ACCURACY,
    bounds=BOUND_ACCURACIES,
    step_mm=STEP_MM,
    map_step_mm=COARSE_STEP_MM,
    map_places=COARSE_PLACES,
    bound_places=COARSE_PLACES,
    bound_depths_mm=COARSE_DEPTHS_MM,
    settled="open",
    doubts=(MAP_ACCURACY, *DOUBT_ACCURACIES),
    has_felt=True,
    has_losses=True,
)
_FULL = replace(_SCORE, map_step_mm=STEP_MM, map_places=FINE_PLACES, bound_places=FINE_PLACES)

SETTINGS = {
    "draft": Settings(
        untouched=_QUICK,
        pairs=replace(_QUICK, rings=16, columns=40, image_step=0.2, top_rings=14, top_columns=32),
        map=_DRAFT_MAP,
        near=None,
        bounds=(ACCURACIES["score"],),  # coarser light leaves voxels open, which then pass for blind
        step_mm=COARSE_STEP_MM,
        map_step_mm=2 * COARSE_STEP_MM,
        map_places=COARSE_PLACES,
        bound_places=3,
        bound_depths_mm=(1.5,),
        bound_depth_share=HALF_OF_DEPTH,
        near_tips=NEAR_TIPS,
        settled="close",
        doubts=DOUBT_ACCURACIES[:1],
        has_felt=True,
    ),
    "search": Settings(
        untouched=_QUICK,
        pairs=replace(_QUICK, image_step=0.1, top_rings=14, top_columns=32, repeat_share=1e-3),
        map=_QUICK,
        near=None,
        bounds=(_QUICK,),
        step_mm=COARSE_STEP_MM,
        map_step_mm=2 * COARSE_STEP_MM,
        map_places=3,
        bound_places=3,
        bound_depths_mm=(0.7, 2.5),
    ),
    "score": _SCORE,
    "full": _FULL,
    "fine": replace(
        _FULL,
        pairs="fine",
        map=ACCURACIES["standard"],
        bound_depths_mm=FINE_DEPTHS_MM,
        doubts=(ACCURACIES["standard"], *DOUBT_ACCURACIES),
    ),
}
"""Rows by name."""


def settings_of(*, fine: bool, full: bool) -> Settings:
    """The row of a score."""
    return SETTINGS["fine" if fine else "full" if full else "score"]
