"""The packaged designs: what they claim, and that nothing stands in their way."""

from __future__ import annotations

import tomllib

import pytest

from optopad.design.errors import InputError
from optopad.design.preset import PRESETS, new_text, preset, preset_text
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of, facing_pairs
from optopad.design.spec import SensorDesign
from tests.said import says


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_has_no_errors(name: str) -> None:
    assert [finding for finding in check(preset(name)) if finding.severity == "error"] == []


@pytest.mark.parametrize("name", PRESETS)
def test_a_new_design_is_the_preset_without_what_is_said_of_the_preset(name: str) -> None:
    text = new_text("my-pad", name)
    design = SensorDesign.from_document(tomllib.loads(text), where="my-pad")
    assert (design.name, design.description) == ("my-pad", "")
    assert design.with_(name=name, description=preset(name).description).digest == preset(name).digest
    assert text.count("#") == preset_text(name).count("#")
    assert says(text, f"This design ... {name}.\n# Lengths")


def test_the_published_pad_is_as_stated() -> None:
    pad = preset("piacenza2017-pad")
    cavity = cavity_of(pad)
    assert (pad.mold.outer_length_mm, pad.mold.outer_width_mm) == (45.0, 45.0)
    assert (cavity.length_mm, cavity.width_mm, cavity.clear_mm, cavity.black_mm) == (32.0, 32.0, 8.0, 1.0)
    assert (len(cavity.emitters), len(cavity.receivers)) == (8, 8)
    assert (cavity.workspace.x0_mm, cavity.workspace.x1_mm) == (6.0, 26.0)
    assert pad.elastomer.mixing_ratio == 20.0
    assert pad.indenter.tip_radius_mm == 3.0
    assert pad.board.frame_rate_hz == 60.0
    assert pad.operating.max_depth_mm == 5.0


def test_the_published_pair_is_as_stated() -> None:
    pair = cavity_of(preset("piacenza2017-pair"))
    assert (len(pair.emitters), len(pair.receivers)) == (3, 3)
    assert facing_pairs(pair)[0] == (1, 1)
    assert pair.length_mm == 20.0
    assert pair.emitters[0].part_id == "sunled-xscwd23mb"
    assert pair.receivers[0].part_id == "osram-sfh206k"


def test_an_unknown_preset_offers_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean piacenza2017-pad") as caught:
        preset("piacenza-pad")
    assert all(name in str(caught.value) for name in PRESETS)


@pytest.mark.parametrize(
    ("name", "start"),
    [
        ("piacenza2017-pad", "0c3a4f54dac2"),
        ("piacenza2017-pair", "cfa40125d7eb"),
        ("oblong-60x40", "f47ad7800653"),
        ("fingertip-16", "823cc13780b1"),
    ],
)
def test_a_new_option_that_is_absent_leaves_the_digest_of_a_preset(name: str, start: str) -> None:
    assert preset(name).digest.startswith(start)  # as before `elastomer.viscoelastic` came
