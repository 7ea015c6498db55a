"""The verdict's first line, the figures that a design is chosen by, and the line of its size."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from optopad.design.fields.quantity import Cost
from optopad.design.mold.outline import outline_of
from optopad.design.preset import preset
from optopad.fabrication.sheets import bom
from optopad.screen import figures
from optopad.screen.figures import SUMMARY_ROOM, figures_of, summary_words
from optopad.screen.verdict_sentences import verdict_words
from optopad.sims.score.sweep import sweep_row
from tests.sims.made_up_bounds import made_up_bounds
from tests.sims.made_up_scores import contiguous_score, dead_score, out_of_scope_score

PAD = preset("piacenza2017-pad")


def test_a_plain_verdict_is_one_word() -> None:
    assert verdict_words(contiguous_score()) == "CONTIGUOUS"
    assert verdict_words(dead_score()) == "DEADBAND"
    assert verdict_words(out_of_scope_score()) == "OUT_OF_MODEL_SCOPE"


def test_a_range_that_ends_early_is_named_with_what_was_asked() -> None:
    faded = replace(contiguous_score(), usable_depth_mm=4.3, usable_range_mm=(4.28, 4.3))
    assert verdict_words(faded) == "CONTIGUOUS to 4.3 of the 5 mm required"
    unsure = replace(faded, usable_range_mm=(3.9, 5.0))
    assert verdict_words(unsure).endswith("(3.9 to 5.0 mm by numerical error)")


def test_an_undecided_verdict_says_so() -> None:
    words = verdict_words(replace(contiguous_score(), is_open=True))
    assert words.startswith("CONTIGUOUS, undecided")


def test_a_row_of_a_table_says_what_the_score_says() -> None:
    faded = replace(dead_score(), usable_depth_mm=4.3, usable_range_mm=(4.3, 4.3))
    assert verdict_words(faded) == "DEADBAND, usable to 4.3 of the 5 mm required"
    assert sweep_row(PAD, 8.0, faded).headline == "DEADBAND, usable to 4.3 of 5 mm"
    undecided = replace(faded, verdict="CONTIGUOUS", is_open=True, usable_depth_mm=4.98)
    assert verdict_words(undecided).startswith("CONTIGUOUS, undecided, to 4.98 of")
    assert sweep_row(PAD, 8.0, undecided).headline == "CONTIGUOUS, undecided, to 4.98 of 5 mm"
    assert sweep_row(PAD, 8.0, out_of_scope_score()).headline == "OUT_OF_MODEL_SCOPE"


def test_the_figures_are_those_of_score_and_mold_and_are_plain_data() -> None:
    score = replace(contiguous_score(), bounds=made_up_bounds(PAD), margin=5.94)
    found = figures_of(PAD, score)
    bounds, mold = score.bounds, outline_of(PAD)
    assert bounds is not None
    assert bounds.detection is not None
    assert score.force is not None
    document = found.to_json()
    assert document["margin_noise_units"] == 5.94
    assert document["location_bound_mm"] == pytest.approx(bounds.median_location_mm.value, rel=1e-4)
    assert document["depth_bound_mm"] == pytest.approx(bounds.median_depth_mm.value, rel=1e-4)
    worst = bounds.detection.force_n[bounds.detection.worst]
    assert document["detection_force_n"] == pytest.approx(float(worst), rel=1e-4)
    assert document["deepest_force_n"] == pytest.approx(float(score.force.force_n[-1]), rel=1e-4)
    assert document["unresolved_share"] == pytest.approx(bounds.blind_share, rel=1e-4)
    inset = PAD.indenter.tip_radius_mm + PAD.operating.workspace_margin_mm
    side = PAD.cavity.length_mm - 2 * inset
    assert document["pressable_mm"] == [side, side]
    assert document["pressable_share"] == pytest.approx((side / PAD.cavity.length_mm) ** 2, rel=1e-3)
    assert document["outer_mm"] == [mold.outer_length_mm, mold.outer_width_mm, mold.height_mm]
    assert document["parts"] == 16
    assert figures_of(PAD, score.to_json()) == found  # from the plain data as well
    pair = preset("piacenza2017-pair")
    facing = replace(contiguous_score(pair), bounds=made_up_bounds(pair))
    assert facing.bounds is not None
    alone = facing.bounds.median_depth_alone_mm.value
    assert figures_of(pair, facing).to_json()["depth_bound_mm"] == pytest.approx(alone, rel=1e-4)
    assert figures_of(pair, facing).unresolved is None


def test_a_pad_that_resolves_or_detects_nothing_has_no_number_and_no_infinity() -> None:
    bounds = made_up_bounds(PAD)
    blind = replace(bounds, location_mm=bounds.location_mm + math.inf)
    found = figures_of(PAD, replace(contiguous_score(), bounds=blind))
    assert found.to_json()["location_bound_mm"] is None
    assert found.to_json()["unresolved_share"] == pytest.approx(1.0)
    assert {cell.name: cell.text for cell in found.cells}["location"] == "none"
    for score in (out_of_scope_score(), None):
        found = figures_of(PAD, score)
        assert {found.margin, found.location_mm, found.detection_n, found.deepest_n} == {None}
        json.dumps(found.to_json(), allow_nan=False)


def test_a_crown_and_a_collar_count_in_the_height_and_a_disc_has_the_share_of_a_disc() -> None:
    dome, disc = preset("fingertip-dome"), preset("levi2013-disc")
    mold = outline_of(dome)
    assert figures_of(dome, None).outer_mm[2] == pytest.approx(mold.plan.clear_mm - mold.bottom_mm, abs=1e-3)
    assert dome.cavity.clear_thickness_mm > mold.fill_mm
    found = figures_of(disc, None)
    across = disc.cavity.length_mm
    assert found.pressable_share == pytest.approx((found.pressable_mm[0] / across) ** 2, rel=0.02)


def test_the_line_of_size_fits_and_says_what_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    score = replace(contiguous_score(), bounds=made_up_bounds(PAD))
    assert (
        summary_words(PAD, None)
        == "45 x 45 x 13.5 mm outside, pressable 20 x 20 of 32 x 32 mm, 16 parts, no price known"
    )
    assert (
        summary_words(PAD, score)
        == "45 x 45 x 13.5 mm outside, pressable 20 x 20 of 32 x 32 mm, load 0.02 to 37 N, 16 parts"
    )

    def priced(design, gain=None):  # type: ignore[no-untyped-def]
        cost = Cost(value=8.9, currency="EUR", date="2026-01", source="a shop")
        rows = list(bom.bom_rows(design, gain))
        rows[0] = replace(rows[0], cost=cost, order_quantity=4)
        return tuple(rows)

    monkeypatch.setattr(figures, "bom_rows", priced)
    words = summary_words(PAD, score)
    assert len(words) <= SUMMARY_ROOM
    assert "36 EUR + " in words
    for name in ("gripper-stadium", "fingertip-dome", "oblong-60x40"):
        assert len(summary_words(preset(name), None)) <= SUMMARY_ROOM
    (price,) = [cell for cell in figures_of(PAD, None).cells if cell.name == "price"]
    assert price.value is None  # a sum of some rows ranks nothing
    assert figures_of(PAD, None).to_json()["price"]["known"] == {"EUR": 35.6}
