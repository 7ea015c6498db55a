"""What share of builds keeps the verdict: a Monte Carlo over everything that may be off on a build.

    tolerances ──► Sobol points, scrambled with the seed ──► builds ──► verdict in brief ──► share that keeps it

Each build is the design with all its tolerances drawn at once, the gain set anew as it would be on that build, and
judged as the design itself is judged here: facing rows by all facing pairs, a pad at its weakest place. The light's own
random shifts are the same for all builds, so two builds differ by what was changed.

Uncertainty: the share carries the exact binomial interval (Clopper and Pearson 1934) at 95 %; Sobol points are more
even than random ones, so the interval errs on the wide side. It is the uncertainty of the *count*, not of the
tolerances, which are assumptions. Builds whose verdict the light trace's own error may turn are counted apart.

What matters most: Spearman's rank correlation of each value with how firm the build's verdict is (its margin to a
deadband; among builds with one, minus its length), with Fisher's 95 % interval. It sees a value's effect among
all the others; the one-at-a-time ends (`tolerance`) see it alone.

Left out: what `design.spec.tolerances` leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from math import ceil, log2
from typing import Any, Protocol

import numpy as np

from design.arrays import BoolArray, FloatArray
from design.errors import InputError, OptopadError
from design.spec import SensorDesign
from design.spec.tolerances import Tolerance
from sims.verdict.builds import Brief

CONFIDENCE = 0.95
NORMAL_95 = 1.959964
CUT_SIGMA = 2.0
"""A normal tolerance's ends lie this many standard deviations from its middle, and nothing beyond."""
FEWEST_BUILDS, MOST_BUILDS = 10, 100_000


class Memo(Protocol):
    """Where finished builds are kept, so that an interrupted study goes on where it stopped."""

    def get(self, name: str) -> Any | None:
        """What was kept under a name; None when nothing."""

    def put(self, name: str, result: Any) -> None:
        """Keep plain data under a name."""


@dataclass(frozen=True, kw_only=True)
class BuildStudy:
    """The builds of a study.

    Attributes
    ----------
    judged : what was judged
    seed : of the draw
    as_designed : the design itself, judged as the builds are
    tolerances : what was varied, in the order of `values`
    values : (build, tolerance) drawn values, each in its unit
    deadband_mm, margin : (build,) summed deadband [mm] and margin to one [noise units]; NaN where nothing was judged
    in_doubt : (build,) whether the light trace's error may turn the verdict
    unjudged : why builds could not be judged, with the number of builds
    """

    judged: str
    seed: int
    as_designed: Brief
    tolerances: tuple[Tolerance, ...]
    values: FloatArray
    deadband_mm: FloatArray
    margin: FloatArray
    in_doubt: BoolArray
    unjudged: dict[str, int]

    @property
    def builds(self) -> int:
        """Builds that were judged."""
        return int(np.isfinite(self.deadband_mm).sum())

    @property
    def kept(self) -> int:
        """Builds that keep the verdict."""
        judged = self.deadband_mm[np.isfinite(self.deadband_mm)]
        return int(((judged > 0.0) == (self.as_designed.deadband_mm > 0.0)).sum())

    @property
    def kept_share(self) -> float:
        """Share of the judged builds that keep the verdict [-]."""
        return self.kept / self.builds

    @property
    def kept_interval(self) -> tuple[float, float]:
        """Exact binomial interval of that share at 95 % [-]."""
        from scipy.stats import binomtest  # takes long to import, and only a study needs it

        found = binomtest(self.kept, self.builds).proportion_ci(CONFIDENCE, method="exact")
        return float(found.low), float(found.high)

    @property
    def doubtful(self) -> int:
        """Judged builds whose verdict the light trace's error may turn."""
        return int(self.in_doubt.sum())

    @property
    def firmness(self) -> FloatArray:
        """(build,) margin of builds without a deadband, minus its length for builds with one; an order, no unit."""
        return np.where(self.deadband_mm > 0.0, -self.deadband_mm, self.margin)

    def rank_correlations(self) -> tuple[tuple[float, float, float], ...]:
        """Spearman's correlation of each value with `firmness`, and its 95 % interval; zeros where all builds agree."""
        from scipy.stats import spearmanr

        judged = np.isfinite(self.deadband_mm)
        firm, count = self.firmness[judged], int(judged.sum())
        if count < 4 or np.ptp(firm) == 0.0:
            return ((0.0, -1.0, 1.0),) * len(self.tolerances)
        return tuple(
            _with_interval(float(spearmanr(column, firm).statistic), count)
            for column in self.values[judged].T
        )

    @property
    def ranking(self) -> tuple[int, ...]:
        """Numbers of the tolerances, the strongest rank correlation first."""
        strength = [abs(value) for value, _, _ in self.rank_correlations()]
        return tuple(sorted(range(len(strength)), key=lambda number: -strength[number]))

    def to_json(self) -> dict[str, Any]:
        """Plain data for JSON."""
        low, high = self.kept_interval
        correlations = self.rank_correlations()
        return {
            "judged": self.judged,
            "seed": self.seed,
            "builds": self.builds,
            "kept": self.kept,
            "kept_share": round(self.kept_share, 4),
            "kept_share_95": [round(low, 4), round(high, 4)],
            "in_doubt": self.doubtful,
            "unjudged": self.unjudged,
            "as_designed": _brief_json(self.as_designed),
            "deadband_mm_quantiles": _quantiles(self.deadband_mm),
            "margin_noise_units_quantiles": _quantiles(self.margin),
            "values": [
                {
                    **asdict(self.tolerances[number]),
                    "rank_correlation": round(correlations[number][0], 4),
                    "rank_correlation_95": [round(end, 4) for end in correlations[number][1:]],
                }
                for number in self.ranking
            ],
        }


def build_study(
    design: SensorDesign,
    tolerances: Sequence[Tolerance],
    judged: str,
    judge: Callable[[SensorDesign], Brief],
    *,
    builds: int,
    seed: int,
    on_step: Callable[[float], None] | None = None,
) -> BuildStudy:
    """Judge builds with all tolerances drawn at once.

    Parameters
    ----------
    judge : the brief of a build; called for the design as it is first
    builds : how many; a power of two covers the tolerances most evenly

    Raises
    ------
    InputError : a number of builds that is too small or too large, or nothing that varies.
    """
    if not FEWEST_BUILDS <= builds <= MOST_BUILDS:
        raise InputError(f"--builds: {builds} is refused: needs {FEWEST_BUILDS} to {MOST_BUILDS} builds")
    if not tolerances:
        raise InputError("--tolerance: nothing varies: every value was measured or has a tolerance of 0")
    as_designed, values = judge(design), drawn_values(tolerances, builds, seed)
    briefs: list[Brief | None] = []
    unjudged: dict[str, int] = {}
    for number, row in enumerate(values):
        changes = {one.path: float(value) for one, value in zip(tolerances, row, strict=True)}
        try:
            briefs.append(judge(design.with_(**changes)))
        except OptopadError as err:
            reason = str(err).split(":")[0]
            unjudged[reason] = unjudged.get(reason, 0) + 1
            briefs.append(None)
        if on_step is not None:
            on_step((number + 1) / builds)
    if not any(briefs):
        raise InputError(
            f"--tolerance: no build could be judged ({', '.join(unjudged)}); narrow the tolerances"
        )
    return BuildStudy(
        judged=judged,
        seed=seed,
        as_designed=as_designed,
        tolerances=tuple(tolerances),
        values=values,
        deadband_mm=np.array([np.nan if one is None else one.deadband_mm for one in briefs]),
        margin=np.array([np.nan if one is None else one.margin for one in briefs]),
        in_doubt=np.array([one is not None and one.in_doubt for one in briefs]),
        unjudged=unjudged,
    )


def drawn_values(tolerances: Sequence[Tolerance], builds: int, seed: int) -> FloatArray:
    """(build, tolerance) values: scrambled Sobol points through each tolerance's distribution."""
    from scipy.stats import qmc

    sobol = qmc.Sobol(len(tolerances), scramble=True, rng=np.random.default_rng(seed))
    points = sobol.random_base2(ceil(log2(builds)))[:builds]
    columns = [_quantile(one, column) for one, column in zip(tolerances, points.T, strict=True)]
    return np.stack(columns, axis=1)


def remembered(
    judge: Callable[[SensorDesign], Brief], memo: Memo | None, name: str
) -> Callable[[SensorDesign], Brief]:
    """A judge that looks a build up first, and keeps what it finds."""
    if memo is None:
        return judge

    def recalled(build: SensorDesign) -> Brief:
        key = f"{name} {build.digest}"
        earlier = memo.get(key)
        if earlier is not None:
            return Brief(**earlier)
        found = judge(build)
        memo.put(key, asdict(found))
        return found

    return recalled


def _quantile(tolerance: Tolerance, shares: FloatArray) -> FloatArray:
    from scipy.stats import truncnorm, uniform

    low, high = tolerance.low, tolerance.high
    if tolerance.distribution == "uniform":
        found = uniform.ppf(shares, loc=low, scale=high - low)
    else:
        sigma = (high - low) / (2.0 * CUT_SIGMA)
        found = truncnorm.ppf(shares, -CUT_SIGMA, CUT_SIGMA, loc=(low + high) / 2.0, scale=sigma)
    return np.asarray(found, dtype=np.float64)


def _with_interval(correlation: float, count: int) -> tuple[float, float, float]:
    """A correlation with Fisher's interval; 1.06 widens it for ranks (Fieller, Hartley and Pearson 1957)."""
    if not np.isfinite(correlation):
        return 0.0, -1.0, 1.0
    middle = np.arctanh(np.clip(correlation, -0.999999, 0.999999))
    half = NORMAL_95 * np.sqrt(1.06 / (count - 3))
    return correlation, float(np.tanh(middle - half)), float(np.tanh(middle + half))


def _brief_json(brief: Brief) -> dict[str, Any]:
    return {
        "deadband_mm": round(brief.deadband_mm, 4),
        "margin_noise_units": round(brief.margin, 3),
        "mode_gap_mm": None if brief.gap_mm is None else round(brief.gap_mm, 4),
    }


def _quantiles(values: FloatArray) -> dict[str, float]:
    shares = (5, 25, 50, 75, 95)
    found = np.nanpercentile(values, shares)
    return {f"{share} %": round(float(value), 4) for share, value in zip(shares, found, strict=True)}
