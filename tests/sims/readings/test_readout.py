"""Gains of the receivers: common, each, in ohms."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.transimpedance import fitted_counts_per_flux
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.preset import preset
from optopad.sims.readings.readout import HEADROOM, Readout, readout_of

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
