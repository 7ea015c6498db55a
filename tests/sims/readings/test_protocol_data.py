"""Data of a protocol, drawn from made-up light: what belongs to the seed, to the press, to the design."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.press_protocol import PressProtocol, protocol_from
from optopad.design.recordings import kept_share
from optopad.sims.readings.press_data import KNOTS_MM, PressCurves
from optopad.sims.readings.protocol import ProtocolCurves, draw, drawn_presses, untouched_readout
from optopad.sims.readings.signal_chain import chain_of, without_noise

PAD = preset("piacenza2017-pad")
PROTOCOL = protocol_from(
    {
        "name": "small",
        "approach": [{"from_mm": -1.0, "to_mm": 3.0, "step_mm": 0.5}],
        "sets": [
            {"name": "train", "role": "train", "is_ambient": True, "grid_mm": 10.0},
            {"name": "test", "role": "test", "is_ambient": False, "random_places": 5},
        ],
    },
    where="small",
)
POINTS = 18
PRESSES = 9 + 5


def made_up_light(
    design=PAD, protocol: PressProtocol = PROTOCOL, loose: float | None = None
) -> ProtocolCurves:
    """Smooth light that falls with depth and tells places and pairs apart; `loose` times as much with loose walls."""
    places = protocol.places_mm(design)
    distinct = np.concatenate(places)
    starts = np.cumsum([0, *map(len, places)])
    depth = np.array(KNOTS_MM)
    pair = 3e-3 * (1.0 + np.arange(64).reshape(8, 8) / 64)
    drop = np.exp(-depth[:, None] * distinct[:, 0] / 30.0).T
    curves = PressCurves(places_mm=distinct, depth_mm=depth, flux=drop[:, :, None, None] * pair)
    return ProtocolCurves(
        design=design,
        protocol=protocol,
        curves=curves,
        loose=None if loose is None else replace(curves, flux=curves.flux * loose),
        place_of=tuple(np.arange(a, b) for a, b in pairwise(starts)),
        readout=untouched_readout(design, pair),
    )


def quiet(**noise: Any):
    return without_noise(PAD).with_(**{f"noise.{name}": value for name, value in noise.items()})


def test_a_draw_has_every_sample_of_the_protocol() -> None:
    data = draw(made_up_light())
    assert len(data) == POINTS * PRESSES
    assert data.counts.shape == (POINTS * PRESSES, 9, 8)
    np.testing.assert_array_equal(np.bincount(data.set_number), [9 * POINTS, 5 * POINTS])
    np.testing.assert_array_equal(data.press_mm[:POINTS, 2], PROTOCOL.depth_mm)
    assert data.design_digest == PAD.digest
    assert data.attributes["points_per_press"] == POINTS
    assert data.attributes["noise"]["led_fluctuation"] == 0.002


def test_with_everything_off_counts_are_gain_times_light_at_the_reported_press() -> None:
    curves = made_up_light(quiet())
    data = draw(curves)
    np.testing.assert_array_equal(data.true_press_mm, data.press_mm)
    places = {tuple(at): k for k, at in enumerate(curves.curves.places_mm.tolist())}
    numbers = np.array([places[tuple(at)] for at in data.press_mm[:, :2].tolist()])
    light = curves.curves.at(numbers, data.press_mm[:, 2])
    np.testing.assert_allclose(data.signals(), light * curves.readout.gains, rtol=1e-6)


def test_the_same_seed_gives_the_same_data_and_another_other_noise_and_order() -> None:
    curves = made_up_light()
    first, again, other = draw(curves, seed=1), draw(curves, seed=1), draw(curves, seed=2)
    np.testing.assert_array_equal(first.counts, again.counts)
    assert (first.press_mm[:, :2] != other.press_mm[:, :2]).any()
    grid = np.unique(np.round(first.true_press_mm[first.set_number == 0, :2], 6), axis=0)
    same = np.unique(np.round(other.true_press_mm[other.set_number == 0, :2], 6), axis=0)
    np.testing.assert_array_equal(grid, same)


def test_a_press_is_the_same_alone_as_among_all() -> None:
    """So that an interrupted run goes on with the same data."""
    curves = made_up_light(PAD.with_(**{"noise.release_residue": 0.04}))
    whole = draw(curves, seed=4)
    left = frozenset((s, k) for s in (0, 1) for k in range(9) if (s, k) not in {(0, 7), (1, 2)})
    found = list(drawn_presses(curves, seed=4, but=left))
    assert [(one.set_number[0], one.place_number[0]) for one in found] == [(0, 7), (1, 2)]
    for one in found:
        mask = (whole.set_number == one.set_number[0]) & (whole.place_number == one.place_number[0])
        np.testing.assert_array_equal(one.counts, whole.counts[mask])
        np.testing.assert_array_equal(one.true_press_mm, whole.true_press_mm[mask])


def test_offsets_are_one_for_a_press_and_the_lag_is_on_the_way_back() -> None:
    design = quiet(zero_offset_place_mm=0.05, retract_lag_mm=0.04)
    data = draw(made_up_light(design))
    off = (data.true_press_mm[:, 2] - data.press_mm[:, 2]).reshape(PRESSES, POINTS)
    in_, back = off[:, :9], off[:, 10:]
    np.testing.assert_allclose(in_, in_[:, :1] * np.ones(9), atol=1e-12)
    np.testing.assert_allclose(back - in_[:, :1], 0.04, atol=1e-12)
    assert in_[:, 0].std() == pytest.approx(0.05, rel=0.6)  # of 14 draws


def test_the_error_of_place_is_on_what_the_stage_reports() -> None:
    data = draw(made_up_light(quiet(position_error_mm=0.1)))
    off = (data.true_press_mm[:, :2] - data.press_mm[:, :2]).reshape(PRESSES, POINTS, 2)
    np.testing.assert_allclose(off, off[:, :1] * np.ones((1, POINTS, 1)), atol=1e-12)
    assert off[:, 0].std() == pytest.approx(0.1, rel=0.4)  # of 28 draws


def test_lamps_are_on_in_ambient_sets_only() -> None:
    data = draw(made_up_light(quiet(ambient_counts=50.0)))
    off = data.counts[:, -1]
    np.testing.assert_array_equal(off[data.set_number == 1], 0.0)
    assert off[data.set_number == 0].mean() == pytest.approx(50.0, rel=0.01)


def test_times_rise_within_a_set_press_after_press() -> None:
    data = draw(made_up_light())
    for number in (0, 1):
        assert (np.diff(data.time_s[data.set_number == number]) > 0).all()
    last = data.time_s[data.set_number == 0][-1]
    assert last == pytest.approx(9 * PROTOCOL.press_s - PROTOCOL.travel_s, abs=PROTOCOL.dwell_s + 1 / 60)


def test_loose_walls_blend_signals_and_leave_a_hysteresis() -> None:
    """Twice the light with loose walls: the share that is loose can be read off."""
    design = quiet(wall_unbonded_share=0.5)
    curves = made_up_light(design, loose=1.2)
    data, held = draw(curves), draw(made_up_light(quiet()))
    more = (data.signals() / held.signals())[:POINTS, 0, 0]
    share = (more - 1.0) / 0.2
    deepest = 0.5 * PROTOCOL.deepest_mm / PAD.operating.max_depth_mm
    assert share[8] == pytest.approx(deepest, rel=1e-4)
    assert share[4] < 0.5 * deepest < share[13]  # 1 mm on the way in, 1 mm on the way back


def test_loose_walls_need_their_own_light() -> None:
    with pytest.raises(InputError, match="traced without loose walls"):
        draw(made_up_light(quiet(wall_unbonded_share=0.5)))


def test_the_last_press_is_added_to_the_next_and_after_the_release_to_the_untouched_pad() -> None:
    memory, plain = {"release_residue": 0.1, "release_decay_s": 2.0}, quiet(retract_lag_mm=0.05)
    curves = made_up_light(plain.with_(**{f"noise.{name}": value for name, value in memory.items()}))
    data, held = draw(curves), draw(made_up_light(plain))
    change = ((data.signals() - held.signals()) / curves.readout.gains).reshape(PRESSES, POINTS, 64)
    light = (held.signals() / curves.readout.gains).reshape(PRESSES, POINTS, 64)
    whole = light[:, 8] - light[:, 0]  # of each press at its deepest
    time_s = data.time_s.reshape(PRESSES, POINTS)
    released = int(np.flatnonzero(data.true_press_mm[:POINTS, 2] > 0.0)[-1]) + 1
    begun = time_s[:, :1] - time_s[:, :1] % PROTOCOL.press_s
    np.testing.assert_allclose(change[0, :released], 0.0, atol=1e-9)
    for before, rows in ((0, slice(released, None)), (1, slice(0, released))):
        for k in (1, 5):
            since_s = time_s[k, rows] - begun[k - before] - released * PROTOCOL.dwell_s
            kept = kept_share(since_s, residue=0.1, decay_s=2.0)
            np.testing.assert_allclose(
                change[k, rows], kept[:, None] * whole[k - before], rtol=1e-3, atol=1e-8
            )


def test_another_build_is_drawn_from_the_same_light() -> None:
    curves = made_up_light(quiet())
    chain = chain_of(curves.design, curves.readout)
    other = draw(curves, replace(chain, gains=chain.gains * 0.5))
    np.testing.assert_allclose(other.signals(), 0.5 * draw(curves).signals(), rtol=1e-6)
