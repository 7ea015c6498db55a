"""The packaged designs: what they claim, and that nothing stands in their way."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.draft import Draft
from optopad.design.errors import DesignError, InputError
from optopad.design.mold.outline import outline_of
from optopad.design.once import KEPT, once
from optopad.design.pad import Pad
from optopad.design.preset import PRESETS, new_text, preset, preset_text
from optopad.design.recordings import UNNAMED, SetEntry, sets_json, signals_of
from optopad.design.rules.check import check
from optopad.design.shape.cavity import cavity_of, facing_pairs
from optopad.design.spec import SensorDesign
from tests.said import pattern, says


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


PAIR = preset("piacenza2017-pair")


def test_a_pad_has_the_warnings_of_its_design_and_its_parts() -> None:
    pad = Pad.of(PAIR)
    assert pad.findings == check(PAIR) != ()
    assert pad.circuit is Circuit.of(PAIR)
    assert pad.cavity is pad.circuit.cavity is cavity_of(PAIR)
    assert pad.outline is outline_of(PAIR)
    assert [place.name for place in pad.places] == [part.name for part in pad.cavity.parts]


def test_a_design_with_errors_is_no_pad_and_all_its_errors_are_listed() -> None:
    wrong = PAIR.with_(**{"board.baud": 230_400, "operating.max_depth_mm": 20.0})
    errors = [str(one) for one in check(wrong) if one.severity == "error"]
    assert len(errors) >= 2
    with pytest.raises(DesignError) as refused:
        Pad.of(wrong)
    assert str(refused.value).splitlines()[1:] == [f"  {line}" for line in errors]


def test_a_draft_of_an_unknown_board_has_a_cavity_but_no_circuit() -> None:
    draft = Draft(PAIR.with_(**{"board.kind": "no-board"}))
    assert len(draft.cavity.emitters) == len(cavity_of(PAIR).emitters)
    with pytest.raises(DesignError, match="no-board"):
        _ = draft.circuit


def test_each_design_is_resolved_once_and_an_equal_copy_for_itself() -> None:
    asked: list[SensorDesign] = []

    @once
    def resolved(design: SensorDesign) -> str:
        asked.append(design)
        return design.name

    copy = PAIR.model_copy()
    assert copy == PAIR
    assert [resolved(one) for one in (PAIR, PAIR, copy, PAIR)] == [PAIR.name] * 4
    assert [id(one) for one in asked] == [id(PAIR), id(copy)]


def test_a_refusal_is_not_kept_and_old_designs_are_forgotten() -> None:
    tries = []

    @once
    def resolved(design: SensorDesign) -> str:
        tries.append(design.name)
        if len(tries) == 1:
            raise DesignError("not yet")
        return design.name

    with pytest.raises(DesignError, match="not yet"):
        resolved(PAIR)
    assert resolved(PAIR) == PAIR.name
    for _ in range(KEPT):
        resolved(PAIR.model_copy())
    resolved(PAIR)
    assert len(tries) == 2 + KEPT + 1


@pytest.mark.parametrize("kind", [np.int32, np.float32, np.float64])
def test_signals_are_the_lit_readings_less_those_of_the_last_state_in_the_same_type(kind: type) -> None:
    counts = np.array([[[5, 9], [7, 3], [6, 4]]], dtype=kind)
    signals = signals_of(counts)
    assert signals.dtype == kind
    assert signals.tolist() == [[[-1, 5], [1, -1]]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"role": "exam"}, "'a': role ... 'exam'"),
        ({"pattern": "spiral"}, "'a': pattern ... 'spiral'"),
        ({"is_ambient": 1}, "set 'a': is_ambient is 1, needs true or false"),
    ],
)
def test_a_set_that_says_something_unknown_is_refused(changes: dict[str, object], message: str) -> None:
    fields = {"name": "a", "role": "train", "pattern": "grid", "is_ambient": True}
    with pytest.raises(InputError, match=pattern(message)):
        SetEntry(**(fields | changes))  # type: ignore[arg-type]


def test_sets_are_written_as_files_have_them() -> None:
    assert sets_json([UNNAMED]) == (
        '[{"name": "unnamed", "role": "train", "pattern": "unknown", "is_ambient": true}]'
    )
