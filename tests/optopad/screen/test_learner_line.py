import json

import pytest

from optopad.design.preset import preset
from optopad.screen.answer import learner_words
from optopad.sims.score.cost import quick_prediction_s

PAD = preset("piacenza2017-pad")
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
    document = {"digest": PAD.digest, "learners": learners}
    (folder / "sims").mkdir(exist_ok=True)
    (folder / "sims" / "prediction.json").write_text(json.dumps(document | changes), encoding="utf-8")
    return folder


def test_a_prediction_in_the_bundle_says_what_its_best_learner_reached(tmp_path):
    assert learner_words(bundle(tmp_path), PAD.digest) == (
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
    assert learner_words(bundle(tmp_path, **changes), PAD.digest) == ""


@pytest.mark.parametrize("text", ["", "[]", "{", "null"])
def test_a_damaged_prediction_says_nothing(text, tmp_path):
    (bundle(tmp_path) / "sims" / "prediction.json").write_text(text, encoding="utf-8")
    assert learner_words(tmp_path, PAD.digest) == ""


def test_a_larger_pad_takes_longer():
    at_rest = quick_prediction_s(PAD)
    assert at_rest is not None
    assert quick_prediction_s(preset("oblong-60x40")) > 2.0 * at_rest
