"""Words of a trial and of measuring: which component, by how much, with which verdict; which tool is fine enough."""

from __future__ import annotations

from dataclasses import replace

import pytest

from optopad.design.preset import preset
from optopad.screen.verdict import answer_of
from optopad.screen.verdict_sentences import fix_words, sentences_of, tool_words
from optopad.sims.verdict.trial import Move, Trial, TriedMove
from tests.sims.made_up_scores import dead_score

PAD = preset("piacenza2017-pad")
LOWER = Move(path="receivers.height_mm", parts="R1-R8", was=6.0, to=5.1)
MORE = Move(path="layout.0.parts_per_side", parts="", was=4, to=5)
FOUND = Trial(
    kind="deadband",
    found="move",
    moves=(LOWER,),
    verdict="CONTIGUOUS",
    deadband_mm=0.0,
    usable_mm=5.0,
    margin=6.24,
    judged="all 25 locations, coarse light",
    searched="the pad at x 16, y 16 mm",
    tried=(TriedMove(changes={LOWER.path: 5.1}, deadband_mm=0.0, usable_mm=5.0, margin=6.5),),
    farthest_mm=0.9,
    more_parts_tried=False,
)


def test_the_next_command_makes_the_move_that_helps():
    command = "pad.toml --set receivers.height_mm=6"
    lines = answer_of(PAD, replace(dead_score(), trial=FOUND), "").lines([], command=command)
    said = " ".join(" ".join(lines).split())
    assert (
        "next optopad score pad.toml --set receivers.height_mm=5.1 "
        "(moves R1-R8; trial: CONTIGUOUS to 5 mm, margin 6.2 sigma)"
    ) in said
    assert sentences_of(PAD, replace(dead_score(), trial=FOUND)).fix == fix_words(FOUND)
    more = replace(FOUND, found="more parts", moves=(MORE,))
    lines = answer_of(PAD, replace(dead_score(), trial=more), "").lines([], command="pad.toml")
    assert "optopad improve pad.toml --more-parts" in " ".join(" ".join(lines).split())


@pytest.mark.parametrize(
    ("path", "within", "words"),
    [
        ("receivers.height_mm", 0.2, " with a calliper"),
        ("receivers.height_mm", 0.022, "30 presses"),
        ("receivers.height_mm", 0.012, "measuring microscope"),
        ("receivers.height_mm", 0.004, "measuring microscope"),
        ("part_measurements.x.active_height_mm", 0.35, " with a measuring microscope"),
        ("elastomer.refractive_index", 0.004, " with an Abbe refractometer"),
        ("surfaces.wall_reflectance", 0.004, "30 presses"),
        ("elastomer.youngs_modulus_mpa", 0.1, ""),
    ],
)
def test_the_tool_is_one_that_resolves_what_must_be_known(path, within, words):
    assert words in tool_words(path, within)
