"""The verdict's first line: never a bare one where the range ends early or the light leaves it open."""

from __future__ import annotations

from dataclasses import replace

from design.preset import preset
from optopad.screen.verdict_sentences import verdict_words
from sims.score.sweep import sweep_row
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
