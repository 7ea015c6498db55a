"""Presses become centres and indentations of the engine: flat for one tip a state, nested for several."""

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.sims.optics import tracing
from optopad.sims.optics.engine.trace_states import CLASS_NAMES, RawLight
from tests.oracle.pressed import pressed_tops
from tests.sims.optics.surface.analytic import compact_dimple

PAD = preset("piacenza2017-pad")
NONE = [np.nan] * 3
DIMPLE = compact_dimple(1.0)


@pytest.fixture
def asked(monkeypatch):
    """What the engine is asked for, without tracing it."""
    calls = []

    def record(scene, centres_mm, indentations, **settings):
        calls.append((centres_mm, indentations))
        shape = (len(indentations), len(scene.emitter_wall), len(scene.receiver_wall))
        flux = np.zeros((len(CLASS_NAMES), *shape))
        zeros = np.zeros(shape[0])
        return RawLight(
            flux=flux,
            standard_error=flux[0],
            change_error=flux[0],
            relative_error=zeros,
            is_met=zeros == 0.0,
        )

    monkeypatch.setattr(tracing, "trace_scene", record)
    return calls


def test_one_tip_a_state_is_asked_for_as_such_wherever_it_stands(asked):
    presses = np.array([[NONE, [9.0, 8.0, 1.0]], [[5.0, 5.0, 1.0], NONE], [NONE, NONE]])
    light = tracing.trace(Pad.of(PAD), presses, DIMPLE)
    centres, indentations = asked[0]
    assert centres.tolist() == [[[9.0, 8.0]], [[5.0, 5.0]], [[0.0, 0.0]]]
    assert indentations == [[DIMPLE], [DIMPLE], [None]]
    assert light.presses.tolist() == [[9.0, 8.0, 1.0], [5.0, 5.0, 1.0], [0.0, 0.0, 0.0]]


def test_several_tips_are_asked_for_per_state(asked):
    presses = np.array([[[9.0, 8.0, 1.0], [20.0, 21.0, 1.0]], [NONE, [5.0, 5.0, 1.0]]])
    light = tracing.trace(Pad.of(PAD), presses, DIMPLE)
    centres, indentations = asked[0]
    assert centres.tolist() == [[[9.0, 8.0], [20.0, 21.0]], [[0.0, 0.0], [5.0, 5.0]]]
    assert indentations == [[DIMPLE, DIMPLE], [None, DIMPLE]]
    assert light.presses.shape == (2, 2, 3)
    assert np.isfinite(light.presses).all()


def test_a_state_gives_one_indentation_for_all_or_one_per_tip(asked):
    other = compact_dimple(0.5)
    presses = np.array([[[9.0, 8.0, 1.0], [20.0, 21.0, 1.0]]] * 2)
    tracing.trace(Pad.of(PAD), presses, [DIMPLE, [other, DIMPLE]])
    assert asked[0][1] == [[DIMPLE, DIMPLE], [other, DIMPLE]]
    with pytest.raises(InputError, match="1 indentations for 2 tips of state 1"):
        tracing.trace(Pad.of(PAD), presses, [DIMPLE, [other]])


def test_tips_of_the_contact_model_are_those_of_their_depths():
    ((first, second),) = pressed_tops(PAD, np.array([[[9.0, 8.0, 1.0], [20.0, 21.0, 0.5]]])).near
    assert (first.depth_mm, second.depth_mm) == (1.0, 0.5)


def test_a_tip_that_is_not_finite_is_refused_by_its_state(asked):
    presses = np.array([[[9.0, 8.0, 1.0], NONE], [[9.0, np.nan, 1.0], [5.0, 5.0, 1.0]]])
    with pytest.raises(InputError, match="state 1 is not finite"):
        tracing.trace(Pad.of(PAD), presses, DIMPLE)
    assert asked == []
