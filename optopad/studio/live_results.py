"""Results of the studio's computations, one class per kind of result, each with the digest of its design."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.spec import SensorDesign
from optopad.screen.figures import PadFigures, figures_of
from optopad.sims.score.objective import PlaceCurves
from optopad.sims.score.result import ContinuityScore
from optopad.studio.session import LivePress

Level = Literal["draft", "score", "whole"]


@dataclass(frozen=True, kw_only=True)
class Look:
    """The shape of the pressed top.

    Attributes
    ----------
    press : location and depth of the press
    points_mm : (n, 3) points of the top's mesh in the coordinate system of the cavity [mm]
    triangles : (m, 3) indices of points
    force_n, contact_radius_mm : load [N] and contact radius [mm]; 0 without contact
    """

    digest: str
    press: LivePress
    points_mm: FloatArray
    triangles: IntArray
    force_n: float
    contact_radius_mm: float


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Signals against depth for the pairs under the tip."""

    digest: str
    found: PlaceCurves


@dataclass(frozen=True, kw_only=True)
class Ray:
    """One sample path of light: names of its kind and of its pair, and (n, 3) points in cavity coordinates [mm]."""

    kind: str
    pair: str
    places_mm: FloatArray


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Sample paths of light under a press."""

    digest: str
    press: LivePress
    rays: tuple[Ray, ...]


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Expected readings of a manufactured sensor.

    Attributes
    ----------
    untouched, pressed : (emitter, receiver) readings without contact, and under the press [counts]
    """

    digest: str
    press: LivePress
    untouched: FloatArray
    pressed: FloatArray


@dataclass(frozen=True, kw_only=True)
class LiveVerdict:
    """A verdict on a design.

    Attributes
    ----------
    level : accuracy of the verdict: "draft" from a coarse setting of the light model, "score" as by `optopad score` but
        without tolerance, "whole" with tolerance
    score : score with verdict, map and bounds
    """

    digest: str
    level: Level
    score: ContinuityScore

    def figures(self, design: SensorDesign) -> PadFigures:
        """The figures of the judged design, computed once, since the panel is drawn often."""
        known = vars(self)
        if "_figures" not in known:
            known["_figures"] = figures_of(design, self.score)
        found: PadFigures = known["_figures"]
        return found


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The stage of the running work (empty if no work is running), and the finished share of the stage, 0 to 1."""

    stage: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Failed:
    """The reason why there is no result for a design."""

    digest: str
    text: str


Result = Look | Curves | Rays | Readings | LiveVerdict | Progress | Failed
