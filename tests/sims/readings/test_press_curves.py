"""Curves against depth: what lies between the knots, at the ends, and how far it is from traced light."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import fitted_counts_per_flux
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.sims.readings.press_data import (
    BEYOND_MM,
    KNOTS_MM,
    PressCurves,
    knots_mm,
    traced_curves,
)
from optopad.sims.readings.readout import HEADROOM, Readout, readout_of

DEPTH_MM = np.array(KNOTS_MM)


def made_up(function) -> PressCurves:
    """Two places, 2 + 3 parts; the second place has half the light."""
    shape = function(DEPTH_MM)[:, None, None] * (1.0 + np.arange(6).reshape(2, 3))
    places = np.array([[1.0, 2.0], [3.0, 4.0]])
    return PressCurves(places_mm=places, depth_mm=DEPTH_MM, flux=np.stack([shape, shape / 2]))


def test_knots_are_met_and_places_are_told_apart() -> None:
    curves = made_up(lambda d: 1.0 / (1.0 + d))
    found = curves.at(np.arange(36) % 2, np.repeat(DEPTH_MM, 2))
    np.testing.assert_allclose(found.reshape(18, 2, 2, 3).swapaxes(0, 1), curves.flux, rtol=1e-12)


def test_a_line_in_the_root_of_depth_is_met_between_the_knots() -> None:
    """Hermite pieces with local slopes reproduce straight lines."""
    curves = made_up(lambda d: 5.0 - np.sqrt(d))
    depth = np.linspace(0.0, 5.1, 87)
    found = curves.at(np.zeros(87, dtype=int), depth)[:, 0, 0]
    np.testing.assert_allclose(found, 5.0 - np.sqrt(depth), rtol=1e-12)


def test_a_smooth_drop_is_met_within_what_the_knots_allow() -> None:
    """A drop within half a millimetre of contact, as mode 1 has: 0.5 % of its height."""
    curves = made_up(lambda d: 1.0 + np.exp(-(d**1.5) / 0.5))
    depth = np.linspace(0.0, 5.0, 301)
    found = curves.at(np.zeros(301, dtype=int), depth)[:, 0, 0]
    np.testing.assert_allclose(found, 1.0 + np.exp(-(depth**1.5) / 0.5), atol=5e-3)


def test_no_new_extremum_beside_a_step() -> None:
    """Where the tip enters a straight path the curve must not ring: 1 % of the step at most."""
    curves = made_up(lambda d: np.where(d < 2.2, 1.0, 0.2))
    found = curves.at(np.zeros(501, dtype=int), np.linspace(0, 5.1, 501))[:, 0, 0]
    assert found.max() < 1.008
    assert found.min() > 0.192


def test_above_the_surface_the_pad_is_untouched() -> None:
    curves = made_up(lambda d: 5.0 - np.sqrt(d))
    found = curves.at(np.array([1, 1]), np.array([-10.0, 0.0]))
    np.testing.assert_array_equal(found[0], curves.flux[1, 0])
    np.testing.assert_array_equal(found[1], curves.flux[1, 0])


def test_a_little_beyond_the_last_knot_goes_straight_on_and_no_further() -> None:
    curves = made_up(lambda d: 10.0 - d)
    found = curves.at(np.array([0]), np.array([5.1 + BEYOND_MM]))[0, 0, 0]
    assert found == pytest.approx(10.0 - 5.1 - BEYOND_MM, rel=1e-12)
    with pytest.raises(ModelScopeError, match="deeper than the curves"):
        curves.at(np.array([0]), np.array([5.1 + BEYOND_MM + 0.01]))


def test_many_depths_are_the_same_as_few() -> None:
    """Work in chunks changes nothing."""
    curves = made_up(lambda d: 1.0 / (1.0 + d))
    depth = np.linspace(-1.0, 5.0, 9001)
    number = np.arange(9001) % 2
    found = curves.at(number, depth)
    np.testing.assert_array_equal(found[8000:8010], curves.at(number[8000:8010], depth[8000:8010]))


@pytest.mark.parametrize(
    ("depth", "flux", "message"),
    [
        (DEPTH_MM, np.zeros((2, 17, 2, 3)), "flux has shape"),
        (DEPTH_MM[1:], np.zeros((2, 17, 2, 3)), "must rise from 0"),
        (DEPTH_MM[::-1], np.zeros((2, 18, 2, 3)), "must rise from 0"),
    ],
)
def test_curves_that_cannot_be_are_refused(depth, flux, message) -> None:
    with pytest.raises(InputError, match=message):
        PressCurves(places_mm=np.zeros((2, 2)), depth_mm=depth, flux=flux)


def test_knots_follow_tip_and_range() -> None:
    """The paper's pad has the knots as written; a small tip's are scaled, and end at its deepest press."""
    np.testing.assert_array_equal(knots_mm(preset("piacenza2017-pad")), DEPTH_MM)
    small = preset("fingertip-16")
    knots = knots_mm(small)
    assert small.operating.max_depth_mm <= knots[-1] <= small.operating.max_depth_mm + 0.1
    assert knots[1] == pytest.approx(0.06 * small.indenter.tip_radius_mm / 3.0)
    assert (np.diff(knots) > 0).all()
    shallow = preset("piacenza2017-pad").with_(**{"operating.max_depth_mm": 0.5})
    np.testing.assert_allclose(knots_mm(shallow), [0.0, 0.06, 0.14, 0.26, 0.4, 0.6])


def test_places_of_a_wrong_shape_are_refused() -> None:
    with pytest.raises(InputError, match="places: shape"):
        traced_curves(preset("piacenza2017-pad"), np.zeros((3, 3)))


@pytest.mark.full
def test_the_pads_curves_are_within_the_reading_noise_of_traced_light() -> None:
    """Two places of the paper's figures. Reading noise with rounding is 0.58 counts; the light's error is in it."""
    design = preset("piacenza2017-pad")
    places = np.array([[16.5, 19.1], [6.4, 18.3]])
    curves = traced_curves(design, places)
    between = (curves.depth_mm[1:] + curves.depth_mm[:-1]) / 2
    truth = traced_curves(design, places, depth_mm=np.concatenate([[0.0], between])).flux[:, 1:]
    number = np.repeat(np.arange(len(places)), len(between))
    off = curves.at(number, np.tile(between, len(places))).reshape(truth.shape) - truth
    untouched = traced_curves(design, places[:1], depth_mm=(0.0, 0.06)).untouched
    gains = readout_of(Draft.of(design), untouched, untouched > 1e-3).gains
    assert np.sqrt(((off * gains) ** 2).mean()) < 0.58
    assert np.abs(off * gains).max() < 15.0


PAIR = preset("piacenza2017-pair")
FLUX = np.array([[1e-3, 2e-3, 4e-3], [2e-3, 4e-3, 8e-3], [4e-3, 8e-3, 16e-3]])
ALL = np.ones((3, 3), dtype=bool)


def test_a_common_gain_brings_the_median_of_all_pairs_to_the_target() -> None:
    readout = readout_of(Draft.of(PAIR.with_(**{"gain.feedback_ohm": "common"})), FLUX, ALL)
    assert readout.counts_per_flux == pytest.approx(800.0 / 4e-3)
    assert readout.of_each(3) == (readout.counts_per_flux,) * 3
    assert readout.gains.shape == ()


def test_each_receiver_s_own_median_is_brought_to_the_target() -> None:
    readout = readout_of(Draft.of(PAIR.with_(**{"gain.target_counts": 300.0})), FLUX, ALL)
    assert np.median(FLUX * readout.gains, axis=0) == pytest.approx([300.0] * 3)
    assert readout.counts_per_flux == pytest.approx(np.median(readout.by_receiver))


def test_a_bright_pair_lowers_the_gain_of_its_own_receiver_alone() -> None:
    bright = FLUX.copy()
    bright[0, 1] = 0.1
    plain, lowered = (
        readout_of(Draft.of(PAIR.with_(**{"gain.target_counts": 300.0})), flux, ALL)
        for flux in (FLUX, bright)
    )
    assert lowered.by_receiver[0::2] == plain.by_receiver[0::2]
    assert (bright * lowered.gains).max() == pytest.approx(HEADROOM * 1023.0)


def test_a_receiver_without_a_judged_pair_takes_the_gain_of_all_judged() -> None:
    judged = ALL.copy()
    judged[:, 2] = False
    readout = readout_of(Draft.of(PAIR.with_(**{"gain.target_counts": 250.0})), FLUX, judged)
    assert readout.by_receiver[2] == pytest.approx(250.0 / np.median(FLUX[:, :2]))


def test_ohms_set_the_gain_whatever_the_light() -> None:
    design = PAIR.with_(**{"gain.feedback_ohm": [1e5, 2e5, 3e5]})
    readout = readout_of(Draft.of(design), FLUX, ALL)
    assert readout.by_receiver == pytest.approx(fitted_counts_per_flux(Circuit.of(design)))
    assert readout.by_receiver[2] == pytest.approx(3 * readout.by_receiver[0])


def test_a_dark_receiver_has_no_gain_of_its_own() -> None:
    dark = FLUX * np.array([1.0, 0.0, 1.0])
    with pytest.raises(ModelScopeError, match=r"gain\.target_counts.*R2 receives.*0\.0e\+00"):
        readout_of(Draft.of(PAIR), dark, ALL)


def test_every_way_to_pick_pairs_gives_the_receiver_s_gain() -> None:
    readout = Readout(
        counts_per_flux=2.0,
        full_scale_counts=1023.0,
        read_noise_counts=0.5,
        relative_noise=0.003,
        by_receiver=(1.0, 2.0, 3.0),
    )
    mask = np.array([[True, False, True], [False, True, False]])
    pairs = [(int(i), int(j)) for i, j in np.argwhere(mask)]
    assert readout.of_mask(mask).tolist() == readout.of_pairs(pairs).tolist() == [1.0, 3.0, 2.0]
    assert readout.of_all_pairs(6).tolist() == [1.0, 2.0, 3.0, 1.0, 2.0, 3.0]
    assert readout.counts(np.full((2, 3), 400.0))[0].tolist() == [400.0, 800.0, 1023.0]


def test_a_common_gain_is_the_same_number_for_every_pair() -> None:
    readout = Readout(
        counts_per_flux=7.0, full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003
    )
    assert readout.of_mask(ALL).tolist() == readout.of_all_pairs(9).tolist() == [7.0] * 9
