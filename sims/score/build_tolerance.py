"""Robustness of a score's verdict against the tolerances of a manufactured unit, varied one by one and all at once."""

from __future__ import annotations

from dataclasses import replace

from optopad.design.progress import OnStep
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.tolerances import build_tolerances
from optopad.sims.score.result import ContinuityScore, band_caution
from optopad.sims.verdict.builds import (
    BuildJudge,
    Memo,
    build_study,
    pair_judge,
    place_judge,
    remembered,
    verdict_judge,
)
from optopad.sims.verdict.tolerance import ToleranceBand, tolerance_band

DEFAULT_BUILDS = 200


def with_tolerance(
    design: SensorDesign, score: ContinuityScore, *, seed: int = 0, on_step: OnStep | None = None
) -> ContinuityScore:
    """A score with its verdict judged again at both ends of every unmeasured parameter's uncertainty band.

    Facing rows are judged by their governing pair. A pad is judged at its location of least margin, by the pairs that
    respond there.

    Parameters
    ----------
    score : score of that design, with the map if the design is a pad. If it is out of the models' scope, it is returned
        unchanged
    on_step : called with the name of the running stage and the share of it that is done, 0 to 1
    """
    if score.readout is None:
        return score
    tell = on_step or (lambda _stage, _share: None)
    name, judge, _ = governing_judge(design, score, seed)
    return _with_band(score, tolerance_band(design, name, judge, lambda share: tell("tolerance", share)))


def governing_judge(
    design: SensorDesign, score: ContinuityScore, seed: int
) -> tuple[str, BuildJudge, tuple[float, float]]:
    """Name of the pair or location that decides the verdict, a judge of units by it, and its (x, y) [mm]."""
    pad_map, light, readout = score.pad_map, score.pad_signals, score.readout
    if pad_map is None or light is None or readout is None or score.is_facing_rows:
        pair = next(pair for pair in score.pairs if pair.name == score.governing)
        return *pair_judge(pair.curves.pair, pair.name, seed=seed), pair.curves.press_mm
    weak = pad_map.weakest
    return *place_judge(cavity_of(design), pad_map, light, readout, seed=seed), (weak.x_mm, weak.y_mm)


def _with_band(score: ContinuityScore, band: ToleranceBand) -> ContinuityScore:
    """The score with a new tolerance band; the band's warning replaces that of the previous one."""
    kept = tuple(text for text in score.warnings if text != band_caution(score.tolerance))
    told = band_caution(band)
    return replace(score, tolerance=band, warnings=(*kept, told) if told else kept)


def with_builds(
    design: SensorDesign,
    score: ContinuityScore,
    *,
    builds: int = DEFAULT_BUILDS,
    seed: int = 0,
    memo: Memo | None = None,
    on_step: OnStep | None = None,
) -> ContinuityScore:
    """A score with a Monte Carlo simulation of manufactured units over all tolerances.

    The `tolerance` of the returned score also includes the manufacturing tolerances.

    Parameters
    ----------
    score : score of that design, with the map if the design is a pad. If it is out of the models' scope, it is returned
        unchanged
    builds : number of manufactured units to draw
    memo : store of units that were already judged; if None, all units are judged again

    Raises
    ------
    InputError : the number of units is out of range, or no parameter varies.
    """
    if score.readout is None:
        return score
    tell = on_step or (lambda _stage, _share: None)
    name, judge = verdict_judge(cavity_of(design), score.pad_map, score.pad_signals, score.readout, seed=seed)
    recalled = remembered(judge, memo, name)
    tolerances = build_tolerances(design)
    band = tolerance_band(
        design,
        name,
        recalled,
        lambda share: tell("tolerance", share),
        added=[one.as_used_value for one in tolerances if one.origin != "open value"],
    )
    study = build_study(
        design,
        tolerances,
        name,
        recalled,
        builds=builds,
        seed=seed,
        on_step=lambda share: tell("builds", share),
    )
    return replace(_with_band(score, band), builds=study)
