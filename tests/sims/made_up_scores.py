"""Scores with made-up light, judged by the real rules: what plots and the report are tested on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optopad.design.preset import preset
from optopad.design.shape.cavity import (
    CavityGeometry,
    cavity_of,
    chord_midpoint_mm,
    is_facing_rows,
    judged_pairs,
)
from optopad.design.spec import SensorDesign
from optopad.sims.contact.force_curve import ForceCurve
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import Readout
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.verdict.pad_map import Blindness, DepthReading, PadMap, Place, map_grid_mm
from optopad.sims.verdict.pair_score import score_pair
from optopad.sims.verdict.presses import PairCurves
from optopad.sims.verdict.tolerance import ToleranceBand, ToleranceRow

FULL_SCALE = 1023.0
UNTOUCHED_FLUX = 1.0e-3
WARNINGS = (
    "made-up warning one: the walls are near",
    "the verdict rests on unmeasured parameters: receivers.height_mm 5.7..6.3 (inferred)",
)
CHECKS = {
    "ok": True,
    "digest": "",
    "volumes_mm3": {"mold": {"stl": 17950.1234, "solid": 17950.2}},
    "findings": [
        {"name": "mold: watertight", "value": 1, "limit": 1, "unit": "yes", "state": "ok", "note": ""},
        {
            "name": "mold: web between sockets",
            "value": 0.93,
            "limit": 0.8,
            "unit": "mm",
            "state": "ok",
            "note": "E1 to R1",
        },
        {
            "name": "mold: bodies above the rim",
            "value": 8,
            "limit": 0,
            "unit": "parts",
            "state": "warning",
            "note": "E1, E2: in the way of the leveling blade; raise mold.rim_mm",
        },
    ],
}


def made_up_pair(
    name: str = "E1-R1",
    *,
    mode1_end_mm: float = 0.8,
    onset_mm: float = 3.0,
    last_mm: float = 4.2,
    counts: float = 300.0,
    deepest_mm: float = 5.0,
    pair: tuple[int, int] = (0, 0),
    press_mm: tuple[float, float] = (16.0, 16.0),
) -> JudgedPair:
    """A pair whose mirrored light goes by `mode1_end_mm` and whose direct light goes from onset to last."""
    depth = depth_schedule_mm(deepest_mm)
    top = 0.25 * UNTOUCHED_FLUX * np.exp(-3.0 * depth / mode1_end_mm)
    blocked = np.clip((depth - onset_mm) / (last_mm - onset_mm), 0.0, 1.0)
    direct = 0.65 * UNTOUCHED_FLUX * (1.0 - blocked**2 * (3.0 - 2.0 * blocked))
    diffuse = 0.10 * UNTOUCHED_FLUX * (1.0 - 0.1 * depth / deepest_mm)
    total, error = direct + top + diffuse, np.full_like(depth, 2e-4 * UNTOUCHED_FLUX)
    curves = PairCurves(
        pair=pair,
        press_mm=press_mm,
        depth_mm=depth,
        direct=direct,
        top=top,
        diffuse=diffuse,
        total=total,
        standard_error=error,
    )
    score = score_pair(
        depth,
        direct,
        top,
        total,
        gain_counts_per_flux=counts / total[0],
        full_scale_counts=FULL_SCALE,
        standard_error=error,
    )
    return JudgedPair(name=name, curves=curves, score=score)


def dead_score(design: SensorDesign | None = None) -> ContinuityScore:
    """A score with a deadband somewhere."""
    return _made_up(design or preset("piacenza2017-pad"), onset_mm=3.0)


def contiguous_score(design: SensorDesign | None = None) -> ContinuityScore:
    """A score without any deadband."""
    return _made_up(design or preset("piacenza2017-pad"), onset_mm=0.4)


def out_of_scope_score(design: SensorDesign | None = None) -> ContinuityScore:
    """A score that the models refuse."""
    return replace(
        _made_up(design or preset("piacenza2017-pad"), onset_mm=3.0),
        verdict="OUT_OF_MODEL_SCOPE",
        reason="operating.max_depth_mm: 12 mm is beyond the model's 5.4 mm; press less deep",
        deadbands_mm=(),
        worst_pair_mm=None,
        worst_pair=None,
        mode_gap_mm=None,
        continuity=None,
        evenness=None,
        strength=None,
        pairs=(),
        unjudged={},
        clipped=(),
        untouched_flux=None,
        readout=None,
        pad_map=None,
        force=None,
        tolerance=None,
        warnings=(),
    )


def made_up_depths(
    deadbands_mm: tuple[tuple[float, float], ...] = (),
    *,
    usable_mm: float = 5.0,
    margin: float = 4.0,
    is_open: bool = False,
) -> DepthReading:
    """What frames of a place tell of depth; if it is open, the light's error may hide a deadband."""
    blind = Blindness(deadbands_mm=deadbands_mm, usable_mm=usable_mm)
    hidden = Blindness(deadbands_mm=((0.2, 0.6),), usable_mm=usable_mm)
    return DepthReading(
        blind=blind,
        least=blind,
        most=hidden if is_open else blind,
        margin=margin,
        margin_error=0.2,
        margin_mm=(0.2, 0.5),
        open_mm=((0.2, 0.5),) if is_open else (),
    )


def made_up_map(cavity: CavityGeometry, *, dead_mm: float, places: int = 5) -> PadMap:
    """A map whose deadband falls from the first corner, `dead_mm` long there, to none in the middle."""
    x_mm, y_mm = map_grid_mm(cavity, places)
    found = []
    for row, y in enumerate(y_mm):
        for column, x in enumerate(x_mm):
            length = max(0.0, dead_mm - 0.4 * (row + column))
            bands = ((1.2, 1.2 + length),) if length >= 0.3 else ()
            found.append(
                Place(
                    x_mm=float(x),
                    y_mm=float(y),
                    depths=made_up_depths(bands, margin=0.5 if bands else 4.0 + row + column),
                    answering_pairs=20 + row + column,
                )
            )
    return PadMap(x_mm=tuple(x_mm.tolist()), y_mm=tuple(y_mm.tolist()), places=tuple(found))


def made_up_band(pair: str, deadband_mm: float) -> ToleranceBand:
    """A band of three values, one of which turns the verdict and one of which leaves mode 2 unreached."""
    rows = (
        ToleranceRow(
            path="receivers.height_mm",
            confidence="inferred",
            values=(5.7, 6.3),
            gap_mm=(1.9, 0.2),
            deadband_mm=(deadband_mm + 0.6, 0.0),
            margin=(0.4, 9.0),
            flips=deadband_mm > 0,
        ),
        ToleranceRow(
            path="part_measurements.sunled-xscwd23mb.active_height_mm",
            confidence="unverified",
            values=(1.0, 2.6),
            gap_mm=(None, 0.4),
            deadband_mm=(deadband_mm + 0.2, max(0.0, deadband_mm - 0.1)),
            margin=(1.0, 5.0),
            flips=deadband_mm == 0,
        ),
        ToleranceRow(
            path="surfaces.wall_reflectance",
            confidence="unverified",
            values=(0.03, 0.1),
            gap_mm=(0.61, 0.63),
            deadband_mm=(deadband_mm, deadband_mm),
            margin=(4.0, 4.2),
            flips=False,
        ),
    )
    return ToleranceBand(
        judged=pair,
        deadband_mm=deadband_mm,
        gap_mm=0.6,
        margin=4.1,
        rows=rows,
        unbanded=("elastomer.absorption_db_per_cm",),
    )


def made_up_force(deepest_mm: float = 5.0, band: tuple[float, float] = (0.66, 1.49)) -> ForceCurve:
    """A load of 3.3 N/mm^1.5, and the ends of its band as factors."""
    depth = depth_schedule_mm(deepest_mm)
    load = 3.3 * depth**1.5
    return ForceCurve(
        depth_mm=depth,
        force_n=load,
        contact_radius_mm=3.0 * np.tanh(depth / 1.7),
        low_n=band[0] * load,
        high_n=band[1] * load,
    )


def _made_up(design: SensorDesign, onset_mm: float) -> ContinuityScore:
    cavity = cavity_of(design)
    pairs = tuple(
        made_up_pair(
            f"{cavity.emitters[i].name}-{cavity.receivers[j].name}",
            mode1_end_mm=0.7 + 0.02 * (number % 7),
            onset_mm=onset_mm + 0.02 * (number % 5),
            last_mm=onset_mm + 1.4 + 0.9 * (number % 3),
            counts=240.0 + 25.0 * (number % 9),
            pair=(i, j),
            press_mm=chord_midpoint_mm(cavity, (i, j)),
        )
        for number, (i, j) in enumerate(judged_pairs(cavity))
    )
    facing = is_facing_rows(cavity)
    first = max(pairs, key=lambda pair: (pair.score.deadband_total_mm, -pair.score.evenness))
    governing = pairs[0] if facing else first
    is_dead = bool(governing.score.deadbands_mm)
    pad_map = made_up_map(cavity, dead_mm=1.9 if is_dead else 0.0)
    bands = governing.score.deadbands_mm if facing else pad_map.worst.deadbands_mm
    return ContinuityScore(
        verdict="DEADBAND" if is_dead else "CONTIGUOUS",
        reason="",
        digest=design.digest,
        name=design.name,
        seed=0,
        fine=False,
        is_facing_rows=facing,
        usable_depth_mm=5.0,
        usable_range_mm=(5.0, 5.0),
        deadbands_mm=bands,
        governing=governing.name,
        worst_pair_mm=first.score.deadband_total_mm,
        worst_pair=first.name,
        mode_gap_mm=governing.score.modes.gap_mm,
        continuity=governing.score.continuity,
        evenness=governing.score.evenness,
        strength={
            "untouched_flux": UNTOUCHED_FLUX,
            "untouched_counts": 300.0,
            "swing": 0.87,
            "resolvable_steps": 140.0,
        },
        pairs=pairs,
        unjudged={"E1-R9": 3.2},
        clipped=tuple(pair.name for pair in pairs if pair.score.is_clipped),
        untouched_flux=np.full((len(cavity.emitters), len(cavity.receivers)), UNTOUCHED_FLUX),
        readout=Readout(
            counts_per_flux=300.0 / UNTOUCHED_FLUX,
            full_scale_counts=FULL_SCALE,
            read_noise_counts=0.5,
            relative_noise=0.003,
        ),
        pad_map=pad_map,
        pad_signals=None,
        force=made_up_force(),
        tolerance=made_up_band(governing.name, governing.score.deadband_total_mm),
        warnings=WARNINGS,
    )
