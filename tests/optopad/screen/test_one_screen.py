"""One screen: twelve lines of a hundred characters, whatever there is to say."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from optopad.design.fields.finding import error, warning
from optopad.design.preset import preset
from optopad.report.sections.maps import bounds_words
from optopad.screen.answer import LINES, WIDTH, as_typed, learner_words
from optopad.screen.check import findings_screen
from optopad.screen.verdict import answer_of, bound_lines
from optopad.screen.verdict_sentences import sentences_of
from optopad.sims.score.cost import quick_prediction_s
from optopad.sims.verdict.causes import Cause, Witness
from tests.design.for_each import for_each
from tests.said import says
from tests.sims.made_up_bounds import made_up_bounds
from tests.sims.made_up_scores import contiguous_score, dead_score, out_of_scope_score

PAD, PAIR = preset("piacenza2017-pad"), preset("piacenza2017-pair")
LACKS = ("apart", "used up", "clipped", "dim", "cancel", "slight", "none near")


def witness(lack):
    return Witness(
        pair="E1-R5",
        lack=lack,
        mirrored=0.02,
        straight=0.99,
        untouched_counts=310.4,
        change=1.2,
        mode1_end_mm=1.12,
        mode2_onset_mm=None,
        mode2_end_mm=None,
        reach_mm=3.04,
    )


def cause(lack):
    return Cause(
        kind="deadband",
        place_mm=(16.0, 16.0),
        depth_mm=(1.4, 3.1),
        lack=lack,
        short_mm=1.92 if lack in ("apart", "used up") else None,
        witnesses=() if lack == "none near" else (witness(lack),),
    )


SCORES = [
    (one, made(one)) for one in (PAD, PAIR) for made in (dead_score, contiguous_score, out_of_scope_score)
]


@for_each((design, score, lack) for design, score in SCORES for lack in LACKS)
def test_a_verdict_fits_on_one_screen(design, score, lack):
    if score.deadbands_mm:
        score = replace(score, causes=(cause(lack),))
    score = replace(score, warnings=tuple(f"a long warning {'of many words ' * 30}{n}" for n in range(20)))
    files = "files       outputs/pad-12345678"
    lines = answer_of(design, score, "").lines([files], command="pad.toml")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert lines[0].split()[:2] == ["design", score.name]
    assert lines[1].split()[1].rstrip(":,") == score.verdict
    onward = lines[lines.index(files) + 1 :]
    assert [line[:4] for line in onward] in (["next"], ["next", "    "])
    assert re.search(r"\d+ (more )?warnings: --details", re.sub(r"\s+", " ", " ".join(lines)))


def test_the_errors_of_a_learner_are_below_the_bound_of_a_pad_and_of_nothing_else():
    bounds = made_up_bounds(PAD)
    words = "location 0.36 to 0.83 mm, depth 0.08 mm (simulated kernel-ridge); 0 % false alarms"
    for score, is_shown in (
        (replace(contiguous_score(), bounds=bounds), True),
        (replace(contiguous_score(), bounds=None), False),
        (replace(contiguous_score(PAIR), bounds=made_up_bounds(PAD)), False),
        (out_of_scope_score(PAD), False),
    ):
        lines = answer_of(PAD, score, "").lines([], learner=words)
        labels = [line.split()[0] for line in lines if not line.startswith(" ")]
        assert ("learner" in labels) == is_shown
        if is_shown:
            assert labels.index("learner") == labels.index("resolution") + 1
            assert f"learner     {words}" in lines


def test_it_says_which_value_to_measure_and_how_well():
    # margin 4.1 at 2.0 mm and 1.0 at 1.0 mm: 3 is met (4.1 - 3) / 3.1 of the way, 0.35 mm from the design's value
    assert says(
        sentences_of(PAD, contiguous_score()).confidence,
        "part_measurements.sunled-xscwd23mb.active_height_mm ... 0.35 mm",
    )
    firm = replace(contiguous_score().tolerance, rows=contiguous_score().tolerance.rows[2:])
    words = sentences_of(PAD, replace(contiguous_score(), tolerance=firm)).confidence
    assert "1 parameter" in words
    more = replace(firm, rows=firm.rows * 9)
    assert says(
        sentences_of(PAD, replace(contiguous_score(), tolerance=more)).confidence,
        "9 unmeasured ... 1 parameter",
    )


def test_the_next_command_follows_the_verdict():
    def next_of(score, **kind):
        lines = answer_of(PAD, score, "").lines(
            [], command=as_typed("my pad.toml", ["gain.target_counts=200"]), **kind
        )
        first = next(number for number, line in enumerate(lines) if line.startswith("next"))
        return re.sub(r"\s{2,}", "  ", " ".join(lines[first:])).replace("next  ", "").replace("  ", " ")

    typed = "'my pad.toml' --set gain.target_counts=200"
    unsure = contiguous_score()
    assert f"{typed}" in next_of(unsure)
    firm = replace(unsure, tolerance=replace(unsure.tolerance, rows=unsure.tolerance.rows[2:]))
    assert next_of(firm).startswith(f"optopad run {typed} (mold")
    assert "cad/mold.stl" in next_of(contiguous_score(), is_built=True)
    apart = replace(dead_score(), causes=(cause("apart"),))
    assert f"{typed}" in next_of(apart)


def test_findings_fit_on_one_screen_errors_first():
    long = {"value": "9 mm", "limit": "at most 8 mm", "way_out": "lower the part " * 12}
    found = [warning("mold.rim_mm", "a warning", **long)] * 9 + [
        error("emitters.height_mm", "too high", **long)
    ]
    lines = findings_screen("pad", found, command="score pad.toml")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    assert lines[0] == "design      pad: 1 error, 9 warnings"
    assert lines[1].startswith("error       emitters.height_mm: too high (9 mm; needs at most 8 mm)")
    assert re.fullmatch(r" {12}and \d more; all of them with --details", lines[-1])
    details = findings_screen("pad", found, command="score pad.toml", details=True)
    assert re.sub(r"\s+", " ", " ".join(details)).count(str(found[0]).strip()) == 9
    assert findings_screen("pad", [], command="score pad.toml") == [
        "design      pad: 0 errors, 0 warnings",
        "next        optopad score pad.toml",
    ]


def test_the_screen_says_what_share_is_not_resolved():
    bounds = made_up_bounds(PAD)
    score = replace(contiguous_score(), bounds=bounds)
    share = f"{100 * bounds.blind_share:.0f} %" if bounds.blind_share >= 0.01 else "less than 1 %"
    assert sentences_of(PAD, score).resolution.endswith(f"(median); unresolved in {share} of the volume")
    assert sentences_of(PAD, score).resolution in re.sub(
        r"[ \n]+", " ", " ".join(answer_of(PAD, score, "").lines([]))
    )
    assert f"{share}" in "\n".join(bound_lines(bounds, is_facing=False))
    half = replace(bounds, location_mm=np.where(bounds.depth_mm > np.float64(0), np.inf, bounds.location_mm))
    words = sentences_of(PAD, replace(score, bounds=half)).resolution
    assert "100 % of" in words
    resolved = replace(bounds, location_mm=np.where(np.isinf(bounds.location_mm), 0.1, bounds.location_mm))
    assert "not resolved" not in sentences_of(PAD, replace(score, bounds=resolved)).resolution


def test_no_line_of_bounds_has_a_number_that_is_none():
    bounds = made_up_bounds(PAD)
    detection = bounds.detection
    none = np.full_like(bounds.location_mm, np.inf)
    cases = [
        replace(
            bounds, detection=replace(detection, force_error_high_n=np.full_like(detection.force_n, np.inf))
        ),
        replace(
            bounds,
            detection=replace(
                detection, **dict.fromkeys(("force_n", "depth_mm"), np.full_like(detection.force_n, np.inf))
            ),
        ),
        replace(bounds, location_error_mm=none, depth_error_mm=none, depth_alone_error_mm=none),
        replace(bounds, location_mm=none, depth_bound_mm=none, depth_alone_mm=none),
    ]
    for case in cases:
        said = [line for facing in (False, True) for line in bound_lines(case, is_facing=facing)]
        said.append(sentences_of(PAD, replace(contiguous_score(), bounds=case)).resolution)
        said.append(bounds_words(replace(contiguous_score(), bounds=case)))
        assert not re.search(r"\b(nan|inf)\b", " ".join(said))


LEARNT_PAD = preset("piacenza2017-pad")
ROWS = [
    {"depth_mm": 0.1, "location_median_mm": 4.7, "depth_median_mm": 0.05, "found": 0.1},
    {"depth_mm": 1.0, "location_median_mm": 0.83, "depth_median_mm": 0.08, "found": 1.0},
    {"depth_mm": 5.0, "location_median_mm": 0.36, "depth_median_mm": None, "found": 1.0},
]


def bundle(folder, **changes):
    learners = [
        {
            "learner": "extra-trees",
            "errors": [row | {"location_median_mm": 2.0} for row in ROWS],
            "false_alarms": 0.0,
        },
        {"learner": "kernel-ridge", "errors": ROWS, "false_alarms": 0.002},
    ]
    document = {"digest": LEARNT_PAD.digest, "learners": learners}
    (folder / "sims").mkdir(exist_ok=True)
    (folder / "sims" / "prediction.json").write_text(json.dumps(document | changes), encoding="utf-8")
    return folder


def test_a_prediction_in_the_bundle_says_what_its_best_learner_reached(tmp_path):
    assert learner_words(bundle(tmp_path), LEARNT_PAD.digest) == (
        "location 0.36 to 0.83 mm, depth 0.08 mm (kernel-ridge, simulated); 0 % false alarms"
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"digest": "ab" * 32},
        {"learners": []},
        {"learners": None},
        {"learners": [{"learner": "a", "errors": ROWS[:1], "false_alarms": 0.0}]},
    ],
)
def test_a_prediction_of_another_design_or_without_errors_says_nothing(changes, tmp_path):
    assert learner_words(bundle(tmp_path, **changes), LEARNT_PAD.digest) == ""


@pytest.mark.parametrize("text", ["", "[]", "{", "null"])
def test_a_damaged_prediction_says_nothing(text, tmp_path):
    (bundle(tmp_path) / "sims" / "prediction.json").write_text(text, encoding="utf-8")
    assert learner_words(tmp_path, LEARNT_PAD.digest) == ""


def test_a_larger_pad_takes_longer():
    at_rest = quick_prediction_s(LEARNT_PAD)
    assert at_rest is not None
    assert quick_prediction_s(preset("oblong-60x40")) > 2.0 * at_rest
