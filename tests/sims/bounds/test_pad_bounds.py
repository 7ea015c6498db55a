"""Bounds of the paper's pad with real light: symmetry, independence of seeds, honest errors, files."""

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
from optopad.sims.bounds.fisher import Steps, bounds_of, sensitivities, sensitivity
from optopad.sims.bounds.observability import BOUND_ACCURACIES, own_readout, pad_bounds
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.readout import readout_of
from optopad.sims.score.maps_file import bounds_dataset
from optopad.sims.verdict.presses import untouched_flux

pytestmark = pytest.mark.slow
DEPTHS_MM = (1.0, 2.5)


@pytest.fixture(scope="module")
def both_seeds():
    # 6 mm from two walls and 5 mm deep the pair across the corner is known to about the 5 noise units from which it
    # counts: one seed takes it in, another leaves it out, and bounds jump. From 8 mm on no pair is so near to that.
    # One gain for all: those by receiver differ between mirrored receivers as the untouched light does, by 1e-4.
    design = preset("piacenza2017-pad").with_(
        **{"operating.workspace_margin_mm": 5.0, "gain.feedback_ohm": "common"}
    )
    return [pad_bounds(Draft.of(design), places=3, depths_mm=DEPTHS_MM, seed=seed) for seed in (0, 1)]


def test_the_map_s_light_serves_the_bounds(monkeypatch, tmp_path):
    """Of the twelve presses of a voxel between depths of the map, the two by depth of the first half are the map's."""
    import optopad.sims.optics.engine.trace_states as engine

    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path))
    monkeypatch.setenv("OPTOPAD_LIGHT_CACHE_MB", "50")
    design, traced = preset("piacenza2017-pad"), []
    original = engine._traced_rows

    def counted(work, part, wanted):
        traced.append(len(part))
        return original(work, part, wanted)

    place, depth_mm = np.array([[12.3, 9.1]]), 1.5
    trace(Draft.of(design), np.array([[12.3, 9.1, depth] for depth in (1.4, 1.6)]), accuracy="score", seed=3)
    monkeypatch.setattr(engine, "_traced_rows", counted)
    flat = untouched_flux(Draft.of(design), seed=3)
    readout = readout_of(Draft.of(design), flat, mask_of(judged_pairs(cavity_of(design)), cavity_of(design)))
    traced.clear()
    voxel = np.column_stack([place, [depth_mm]])
    sensitivity(Draft.of(design), voxel, readout, accuracy="score", seed=3, steps=Steps())
    assert sum(traced) == 10


def test_a_half_turn_of_the_paper_s_ring_keeps_the_maps(both_seeds):
    """The ring looks the same after a half turn; its presses are one class to the engine, equal to rounding."""
    maps = both_seeds[0].location_mm
    assert maps == pytest.approx(maps[::-1, ::-1], rel=1e-5)


def test_another_seed_moves_bounds_within_their_stated_errors(both_seeds):
    """Differences of two independent estimates over their stated errors: in the median, and pooled over voxels.

    Few pairs make a voxel's error, and each estimates its own from one difference of halves. So a single voxel follows
    a t law of one to three degrees of freedom, whose largest values say nothing: of 15 pairs of seeds a third had a
    voxel beyond 6. Pooled over the six voxels that differ, the ratio squared follows F(6, 6) or so, 8.5 at 99 %.
    """
    first, second = both_seeds
    for value, error in (("location_mm", "location_error_mm"), ("depth_bound_mm", "depth_error_mm")):
        seen = ~(first.is_blind | second.is_blind)
        assert seen.all(), value
        difference = (getattr(first, value) - getattr(second, value))[seen]
        spread = np.hypot(getattr(first, error), getattr(second, error))[seen]
        # the median of six such values is below 2.5 in 99 %; over four pairs of seeds found 0.4 to 1.9
        assert np.median(np.abs(difference / spread)) < 2.5, value
        assert (difference**2).sum() < 8.5 * (spread**2).sum(), value


def test_the_middle_of_the_press_is_told_to_microns_and_losses_only_worsen_it(both_seeds):
    """0.005 to 0.03 mm is what 64 readings of 0.3 % noise and slopes of tens of counts a millimetre give.

    A pair's information is a product of two halves' derivatives, so by the trace's error it may be less than none.
    """
    bounds = both_seeds[0]
    assert 0.003 < bounds.median_location_mm.value < 0.03
    assert 0.002 < bounds.median_depth_mm.value < 0.01
    for loss in bounds.losses:
        assert loss.median_location_mm.value >= bounds.median_location_mm.low
        assert loss.coverage.value <= bounds.coverage.value
    assert bounds_dataset(bounds).location_bound.shape == bounds.location_mm.shape


@pytest.mark.full
def test_no_pair_of_a_dome_is_left_out_for_an_error_that_all_its_presses_share():
    """What rules may be off is some 2 % of a press's light, several noise units, and leaves derivatives alone."""
    design = preset("fingertip-dome")
    places, depth_mm, readout = (
        np.array([[11.0, 7.5], [11.0, 11.5]]),
        np.array([2.9]),
        own_readout(Draft.of(design), seed=0),
    )
    found, finer = (
        sensitivities(
            Draft.of(design), places, depth_mm, readout, accuracies=accuracies, seed=0, steps=Steps()
        )
        for accuracies in (BOUND_ACCURACIES, ("standard",))
    )
    assert (found.weight > 0.0).all()
    assert bounds_of(found).location_mm == pytest.approx(bounds_of(finer).location_mm, rel=0.1)
