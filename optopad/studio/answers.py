"""What the studio's work finds, piece by piece, each with the digest of the design that it is of."""

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
    press : where, how deep
    points_mm : (n, 3) of the top's mesh [mm]; triangles : (m, 3) numbers of points
    force_n, contact_radius_mm : of the press; 0 where untouched
    """

    digest: str
    press: Press
    points_mm: FloatArray
    triangles: IntArray
    force_n: float
    contact_radius_mm: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Pairs under the tip against depth."""

    digest: str
    found: PlaceCurves


@dataclass(frozen=True, kw_only=True)
class Ray:
    """One sample path of light: the key of its kind, its pair's name, places (n, 3) [mm]."""

    kind: str
    pair: str
    places_mm: FloatArray


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Sample paths under the press as it is."""

    digest: str
    press: Press
    rays: tuple[Ray, ...]


@dataclass(frozen=True, kw_only=True)
class Readings:
    """What a built sensor should read.

    Attributes
    ----------
    untouched, pressed : (emitter, receiver) of the untouched pad, and under the press [counts]
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
    level : draft (a search's light), score (as `optopad score`, tolerance to come), whole (all of it)
    score : verdict, map, bounds
    """

    digest: str
    level: Level
    score: ContinuityScore


@dataclass(frozen=True, kw_only=True)
class Progress:
    """What is being worked at, and the share of it that is done; an empty stage: nothing."""

    stage: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Failed:
    """Why there is no answer for a design."""

    digest: str
    text: str


Answer = Look | Curves | Rays | Readings | Judged | Progress | Failed
