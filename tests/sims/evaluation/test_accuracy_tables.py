from dataclasses import dataclass, replace

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.preset import preset
from optopad.design.recordings import SetEntry
from optopad.sims.learning.inference.touch_model import Prediction
from optopad.sims.learning.tables import (
    JudgedPresses,
    error_json,
    error_rows,
    joined,
    judged,
    needed_samples,
    published_touch,
    touch_rows,
)
from optopad.sims.readings.press_data import PressData

DEPTHS_MM = (-0.4, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0)
PRESSES = 400


@dataclass(frozen=True)
class MadeUp:
    """Presses whose said place is off by a normal error and whose depth is off by a constant."""

    sigma_mm: float = 0.3
    offset_mm: float = -0.07

    def presses(self, seed: int = 0) -> JudgedPresses:
        rng = np.random.default_rng(seed)
        place = np.repeat(rng.uniform(6.0, 26.0, (PRESSES, 2)), len(DEPTHS_MM), axis=0)
        depth = np.tile(DEPTHS_MM, PRESSES)
        true = np.column_stack([place, depth])
        said = true + np.column_stack(
            [rng.normal(0.0, self.sigma_mm, place.shape), np.full(len(depth), self.offset_mm)]
        )
        return JudgedPresses(
            press_mm=true,
            said_mm=said,
            is_found=depth >= 0.2,
            place_number=np.repeat(np.arange(PRESSES), len(DEPTHS_MM)),
            session_number=np.zeros(len(depth), dtype=np.int64),
        )


def test_errors_of_a_normal_place_have_its_closed_forms():
    row = error_rows(MadeUp().presses(), (1.0,))[0]
    assert row.location is not None
    assert row.depth is not None
    # Rayleigh: median sigma sqrt(2 ln 2), mean sigma sqrt(pi / 2); 400 samples leave 4 % (3 standard errors: 12 %)
    assert row.location.median == pytest.approx(0.3 * np.sqrt(2.0 * np.log(2.0)), rel=0.12)
    assert row.location.mean == pytest.approx(0.3 * np.sqrt(np.pi / 2.0), rel=0.08)
    assert row.depth.median == pytest.approx(0.07, abs=1e-12)
    assert row.depth.deviation == pytest.approx(0.0, abs=1e-12)
    assert row.samples == row.presses == PRESSES


def test_the_medians_error_is_that_of_the_law_of_medians():
    row = error_rows(MadeUp().presses(), (1.0,))[0]
    assert row.location is not None
    median = 0.3 * np.sqrt(2.0 * np.log(2.0))
    density = median / 0.3**2 * np.exp(-((median / 0.3) ** 2) / 2.0)
    expected = 1.0 / (2.0 * density * np.sqrt(PRESSES))  # of a sample's median, asymptotically
    assert row.location.median_error == pytest.approx(
        expected, rel=0.35
    )  # the bootstrap of a median is rough


def test_samples_that_one_press_repeats_do_not_make_its_median_surer():
    once = MadeUp().presses()
    twice = JudgedPresses(
        press_mm=np.repeat(once.press_mm, 5, axis=0),
        said_mm=np.repeat(once.said_mm, 5, axis=0),
        is_found=np.repeat(once.is_found, 5),
        place_number=np.repeat(once.place_number, 5),
        session_number=np.repeat(once.session_number, 5),
    )
    one, five = (error_rows(each, (1.0,))[0].location for each in (once, twice))
    assert one is not None
    assert five is not None
    assert five.median_error == pytest.approx(one.median_error, rel=1e-9)


def test_touch_counts_untouched_below_zero_and_touched_from_zero_on():
    rows = {row.depth_mm: row.right for row in touch_rows(MadeUp().presses())}
    assert rows[-0.4] == rows[-0.2] == 1.0
    assert rows[0.0] == 0.0  # touched by the table's rule, and not found
    assert rows[0.2] == rows[1.0] == 1.0
    assert rows[0.6] is None  # no sample there


def test_touch_found_in_half_of_the_presses_has_the_error_of_a_coin():
    presses = MadeUp().presses()
    is_found = presses.place_number % 2 == 0
    half = JudgedPresses(
        press_mm=presses.press_mm,
        said_mm=presses.said_mm,
        is_found=is_found,
        place_number=presses.place_number,
        session_number=presses.session_number,
    )
    row = touch_rows(half, (1.0,))[0]
    assert row.right == 0.5
    assert row.right_error == pytest.approx(
        0.5 / np.sqrt(PRESSES), rel=0.2
    )  # 200 resamples: 5 %, four of them


def test_the_cascade_is_judged_on_what_it_finds_and_says_how_much_that_is():
    presses = MadeUp().presses()
    is_far = presses.location_error_mm > 0.3
    kept = JudgedPresses(
        press_mm=presses.press_mm,
        said_mm=presses.said_mm,
        is_found=~is_far,
        place_number=presses.place_number,
        session_number=presses.session_number,
    )
    row = error_rows(kept, (1.0,))[0]
    assert row.found_location is not None
    assert row.location is not None
    assert row.found_location.p95 <= 0.3 < row.location.p95
    assert row.found == pytest.approx(
        1.0 - np.exp(-0.5), abs=0.08
    )  # Rayleigh within one sigma; 3 standard errors


def test_a_depth_without_samples_has_no_errors_and_plain_nulls():
    row = error_rows(MadeUp().presses(), (5.0,))[0]
    assert row.location is None
    assert error_json([row])[0]["location_mm"] is None


def test_joined_draws_keep_their_sessions_apart_and_know_their_places_again():
    both = joined([MadeUp().presses(0), MadeUp().presses(0)])
    assert set(both.session_number) == {0, 1}
    places = len(np.unique(joined([MadeUp().presses(0)]).place_number))
    assert len(np.unique(both.place_number)) == places
    assert 0.7 * PRESSES < places < PRESSES  # a few of 400 places in 400 mm2 lie within 0.15 mm of another


def test_what_sessions_differ_by_is_in_the_error_of_a_median():
    rng = np.random.default_rng(3)
    draws = []
    for offset in rng.normal(0.0, 0.05, 12):
        presses = MadeUp(sigma_mm=0.01).presses(0)
        said = presses.said_mm + np.array([0.0, 0.0, 0.07 + 0.3 + offset])  # a depth error of 0.3 +- 0.05 mm
        draws.append(replace(presses, said_mm=said))
    row = error_rows(joined(draws), (1.0,))[0]
    assert row.depth is not None
    assert row.depth.median_error == pytest.approx(
        1.25 * 0.05 / np.sqrt(12), rel=0.6
    )  # of a median of 12 sessions


def made_up_data() -> PressData:
    depth = np.round(np.arange(-1.0, 1.01, 0.1), 1)
    places = np.array([(6.0, 6.0), (16.0, 16.0), (26.0, 20.0)])
    press = np.array([(x, y, d) for x, y in places for d in depth])
    count = len(press)
    return PressData(
        counts=np.ones((count, 2, 1), dtype=np.float32),
        press_mm=press,
        time_s=np.arange(count, dtype=np.float64),
        set_number=np.zeros(count, dtype=np.int64),
        place_number=np.repeat(np.arange(len(places)), len(depth)),
        sets=(SetEntry(name="random-dark", role="test", pattern="random", is_ambient=False),),
        state_names=("E1", "off"),
        receiver_names=("R1",),
    )


def test_needed_samples_are_the_tables_depths_and_the_whole_nearest_press():
    data = made_up_data()
    kept = needed_samples(data, np.array([[16.2, 16.1]]))
    whole = kept.only(kept.place_number == 1)
    other = kept.only(kept.place_number == 0)
    assert len(whole) == 21
    assert set(np.round(other.press_mm[:, 2], 1)) == {-0.4, -0.2, 0.0, 0.1, 0.2, 0.4, 0.5, 0.6, 0.8, 1.0}


def test_another_number_of_answers_is_refused():
    data = made_up_data()
    said = Prediction(
        is_touched=np.ones(1, dtype=bool),
        touch_score=np.ones(1),
        press_mm=np.zeros((1, 3)),
        sigma_mm=np.zeros((1, 3)),
        force_n=None,
    )
    with pytest.raises(InputError, match="1 rows for 63 samples"):
        judged(data, said)


def test_the_published_table_is_that_of_the_papers_pad_alone():
    table = published_touch(preset("piacenza2017-pad"))
    assert table is not None
    assert table.right(0.6, is_ambient=True) == 0.76
    assert table.right(0.6, is_ambient=False) == 0.90
    assert table.right(0.7, is_ambient=True) is None
    assert published_touch(preset("oblong-60x40")) is None
