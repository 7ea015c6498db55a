"""Results of the studio's work, one class per piece, each with the digest of its design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from design.arrays import FloatArray, IntArray
from optopad.studio.session import Press
from sims.score.objective import PlaceCurves
from sims.score.result import ContinuityScore

Level = Literal["draft", "score", "whole"]


@dataclass(frozen=True, kw_only=True)
class Look:
    """The pressed top.

    Attributes
    ----------
    press : location and depth
    points_mm : (n, 3) of the top's mesh [mm]; triangles : (m, 3) numbers of points
    force_n, contact_radius_mm : of the press; 0 without contact
    """

    digest: str
    press: Press
    points_mm: FloatArray
    triangles: IntArray
    force_n: float
    contact_radius_mm: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Signals of the pairs under the tip against depth."""

    digest: str
    found: PlaceCurves


@dataclass(frozen=True, kw_only=True)
class Ray:
    """One sample path of light: the key of its kind, the name of its pair, points (n, 3) [mm]."""

    kind: str
    pair: str
    places_mm: FloatArray


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Sample paths under the present press."""

    digest: str
    press: Press
    rays: tuple[Ray, ...]


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Expected readings of a manufactured sensor.

    Attributes
    ----------
    untouched, pressed : (emitter, receiver) without contact, and under the press [counts]
    """

    digest: str
    press: Press
    untouched: FloatArray
    pressed: FloatArray


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A verdict.

    Attributes
    ----------
    level : draft (light of a search), score (as `optopad score`, without its tolerance), whole (complete)
    score : verdict, map, bounds
    """

    digest: str
    level: Level
    score: ContinuityScore


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The stage of the running work, and the finished fraction of it; an empty stage if no work is running."""

    stage: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Failed:
    """The reason why there is no result for a design."""

    digest: str
    text: str


Answer = Look | Curves | Rays | Readings | Judged | Progress | Failed
