"""The page on why depth is not told and on what matters: pictures of the right pair, words of the screen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.report.page import write_report
from optopad.report.scenes.cause_drawing import plot_cause
from optopad.screen.verdict_sentences import cause_sentence
from optopad.sims.verdict.tolerance import Effect, FieldStep, FieldSteps
from tests.optopad.report.page_reader import Page
from tests.optopad.screen.test_one_screen import cause
from tests.sims.made_up_scores import CHECKS, dead_score

pytestmark = pytest.mark.usefixtures("undrawn")
PAD, PAIR = preset("piacenza2017-pad"), preset("piacenza2017-pair")
BASE = Effect(usable_mm=5.0, deadband_mm=0.3, margin=2.0, location_mm=0.01, depth_mm=0.004)
ASIDE_MM = 1.0
STEPS = FieldSteps(
    judged="the pad at x 16, y 16 mm",
    bounds_at_mm=(16.0, 16.0, 2.5),
    as_designed=BASE,
    rows=(
        FieldStep(
            path="receivers.height_mm",
            step=0.1,
            lower=None,
            higher=replace(BASE, margin=4.0, deadband_mm=0.0, location_mm=0.011),
        ),
        FieldStep(path="cavity.clear_thickness_mm", step=0.5, lower=replace(BASE, margin=9.0), higher=BASE),
    ),
)


def page(folder: Path, score) -> str:
    return write_report(PAD, folder, score, CHECKS, seed=7).read_text(encoding="utf-8")


def identifiers(text: str) -> set[str]:
    return {value for _, name, value in Page(text).attributes if name == "id"}


def test_a_deadband_has_its_picture_and_the_words_of_the_screen(tmp_path: Path):
    found = cause("apart")
    text = page(tmp_path, replace(dead_score(), causes=(found,), steps=STEPS))
    assert {"why", "matters"} <= identifiers(text)
    assert text.index('id="why"') < text.index('id="signals"')
    assert cause_sentence(found) in text
    for name in ("plot-cause-1.svg", "plot-field-steps.svg"):
        assert (tmp_path / "sims" / name).is_file()
    assert "Section through E1-R5 under the press" in text


def test_the_section_is_that_of_the_pair_under_the_press():
    """The tip's lowest point is at the interval's depth where the plane meets the axis; the parts at their heights."""
    cavity = cavity_of(PAD)
    e1, r5 = cavity.emitters[0], cavity.receivers[4]
    starts = [np.array(one.position_mm[:2]) for one in (e1, r5)]
    length = float(np.hypot(*(starts[1] - starts[0])))
    chord = (starts[1] - starts[0]) / length
    beside = 0.5 * (starts[0] + starts[1]) + np.array([-chord[1], chord[0]]) * ASIDE_MM
    found = replace(cause("apart"), place_mm=(float(beside[0]), float(beside[1])))
    axes = plot_cause(PAD, found)
    straight = next(
        line for line in axes.lines if list(np.ravel(line.get_xdata())) == pytest.approx([0, length])
    )
    assert list(straight.get_ydata()) == [e1.height_mm, r5.height_mm]
    (begins,) = [patch for patch in axes.patches if patch.get_gid() == "tip"]
    (ends,) = [line for line in axes.lines if line.get_gid() == "deepest-tip"]
    lowest = sorted([float(begins.get_xy()[:, 1].min()), float(np.min(ends.get_ydata()))])
    radius = PAD.indenter.tip_radius_mm
    bulge = radius - np.sqrt(radius**2 - ASIDE_MM**2)
    wanted = sorted(cavity.clear_mm - depth + bulge for depth in found.depth_mm)
    assert lowest == pytest.approx(wanted, abs=0.05)


def test_a_part_s_own_name_may_have_a_hyphen():
    named = PAIR.with_(
        **{
            "layout": [
                {"pattern": "single", "kind": "emitter", "wall": "west", "along_mm": 10.0, "name": "LED-1"},
                {"pattern": "single", "kind": "receiver", "wall": "east", "along_mm": 10.0, "name": "PD-1"},
            ]
        }
    )
    found = cause("apart")
    witness = replace(found.witnesses[0], pair="LED-1-PD-1")
    assert plot_cause(named, replace(found, place_mm=(10.0, 10.0), witnesses=(witness,))) is not None
