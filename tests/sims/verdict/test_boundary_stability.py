"""Mode boundaries and deadbands of the paper's pair and pad do not hang on the depth step or the seed."""

import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.readout import readout_of
from optopad.sims.verdict.builds import score_curves
from optopad.sims.verdict.presses import pair_curves, untouched_flux

BOUNDARY_MM = 0.05
DEADBAND_MM = 0.15


def scores_of(design, *, seed, step_mm, pairs=None):
    cavity = cavity_of(design)
    pairs = pairs or judged_pairs(cavity)
    readout = readout_of(
        Draft.of(design), untouched_flux(Draft.of(design), seed=seed), mask_of(pairs, cavity)
    )
    depth_mm = depth_schedule_mm(design.operating.max_depth_mm, step_mm)
    return [score_curves(c, readout) for c in pair_curves(Draft.of(design), pairs, depth_mm, seed=seed)]


@pytest.mark.slow
@pytest.mark.parametrize("thickness_mm", [8.0, 9.0], ids=["contiguous", "deadband"])
@pytest.mark.parametrize(("seed", "step_mm"), [(0, 0.2), (1, 0.1)], ids=["double step", "other seed"])
def test_boundaries_and_deadbands_stay(thickness_mm, seed, step_mm):
    design = preset("piacenza2017-pair").with_(**{"cavity.clear_thickness_mm": thickness_mm})
    check_same(scores_of(design, seed=0, step_mm=0.1), scores_of(design, seed=seed, step_mm=step_mm))


@pytest.mark.full
def test_boundaries_and_deadbands_of_the_pad_stay():
    """The pairs of one emitter, of the two kinds that the ring's turns leave."""
    design = preset("piacenza2017-pad")
    pairs = tuple(pair for pair in judged_pairs(cavity_of(design)) if pair[0] == 0)
    before = scores_of(design, seed=0, step_mm=0.1, pairs=pairs)
    check_same(before, scores_of(design, seed=0, step_mm=0.2, pairs=pairs))
    check_same(before, scores_of(design, seed=1, step_mm=0.1, pairs=pairs))


@pytest.mark.slow
def test_boundaries_stay_where_mode_1_is_over_in_0_3_mm():
    """Boundaries only: the outer pairs are flat from 0.00 to 0.30 mm, just a deadband's least length, now and then."""
    design = preset("piacenza2017-pair").with_(**{"cavity.clear_thickness_mm": 12.0})
    before = scores_of(design, seed=0, step_mm=0.1)
    check_same(before, scores_of(design, seed=0, step_mm=0.2), with_deadbands=False)


def check_same(before, after, *, with_deadbands=True):
    for old, new in zip(before, after, strict=True):
        ends = zip(
            old.modes.mode1_mm + old.modes.mode2_mm, new.modes.mode1_mm + new.modes.mode2_mm, strict=True
        )
        for was, now in ends:
            assert (was is None) == (now is None)
            if was is not None and now is not None:
                assert now == pytest.approx(was, abs=BOUNDARY_MM)
        if with_deadbands:
            assert new.deadband_total_mm == pytest.approx(old.deadband_total_mm, abs=DEADBAND_MM)
