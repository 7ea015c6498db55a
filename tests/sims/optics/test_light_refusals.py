"""Bad input is refused by name."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.preset import preset
from optopad.sims.optics.engine.trace_states import Accuracy, accuracy_of, trace_scene
from optopad.sims.optics.tracing import trace
from optopad.sims.press import Indentation
from tests.oracle.oracle_scenes import scene_of
from tests.sims.optics.surface.analytic import compact_dimple

SCENE = scene_of([(0, 8.0, 4.0, 0.5, 0.5)], [(2, 8.0, 4.0, 1.3, 1.3)], length_mm=24.0, width_mm=20.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"refractive_index": 0.9}, "refractive_index: 0.9"),
        ({"refractive_index": np.nan}, "refractive_index"),
        ({"absorption_per_mm": -1.0}, "absorption_per_mm"),
        ({"wall_reflectance": 1.0}, "wall_reflectance"),
        ({"height_mm": 0.0}, "height_mm"),
        ({"emitter_order": np.array([-1.0])}, r"emitter_order\[0\]"),
        ({"emitter_order": np.ones(2)}, "one per emitter"),
        ({"emitter_wall": np.array([4])}, r"emitter_wall\[0\]"),
        ({"emitter_patch": np.array([[8.0, 4.0, 0.0, 0.5]])}, "half sizes"),
        ({"emitter_patch": np.array([[0.2, 4.0, 0.5, 0.5]])}, "move it inward"),
        ({"emitter_patch": np.array([[8.0, 9.0, 0.5, 0.5]])}, "clear layer"),
        ({"receiver_patch": np.array([[8.0, np.nan, 0.5, 0.5]])}, "not finite"),
        ({"receiver_patch": np.zeros((0, 4)), "receiver_wall": np.zeros(0, int)}, "receiver_patch"),
        (
            {"emitter_pattern": np.full(9, 1 / np.pi)},
            r"emitter_pattern: shape \(9,\), needs \(1, 2 or more\)",
        ),
        ({"emitter_pattern": np.full((2, 9), 1 / np.pi)}, r"emitter_pattern: shape \(2, 9\)"),
        ({"emitter_pattern": np.full((1, 9), 0.33)}, "1.036.*divide"),
        ({"emitter_pattern": np.array([[0.3, np.nan, 0.3]])}, r"emitter_pattern\[0, 1\]: nan"),
        ({"emitter_pattern": np.array([[-0.1, 0.5, 0.3]])}, r"emitter_pattern\[0, 0\]: -0.1"),
        ({"receiver_response": np.ones((3, 9))}, r"receiver_response: shape \(3, 9\)"),
        ({"receiver_response": np.array([[0.0, 1.2]])}, r"receiver_response\[0, 1\]: 1.2"),
        ({"receiver_response": np.array([[np.nan, 1.0]])}, r"receiver_response\[0, 0\]: nan"),
        ({"wall_index": 0.9}, "wall_index: 0.9, must lie in 1 to 4"),
        ({"wall_index": np.nan}, "wall_index"),
    ],
)
def test_a_bad_scene_is_refused_by_field(changes, message):
    with pytest.raises(InputError, match=message):
        trace_scene(replace(SCENE, **changes), np.zeros((1, 2)), [None])


def test_a_press_outside_the_block_is_refused():
    with pytest.raises(InputError, match="outside the block"):
        trace_scene(SCENE, np.array([[25.0, 5.0]]), [compact_dimple(1.0)])


def test_a_tip_that_overlaps_a_wall_is_out_of_scope():
    with pytest.raises(ModelScopeError, match="to the wall"):
        trace_scene(SCENE, np.array([[1.0, 5.0]]), [compact_dimple(1.0)])


def test_a_press_through_the_layer_is_out_of_scope():
    with pytest.raises(ModelScopeError, match="through the clear layer"):
        trace_scene(SCENE, np.array([[10.0, 10.0]]), [compact_dimple(8.5)])


def test_a_profile_with_nan_is_refused():
    good = compact_dimple(1.0)
    height = good.height_mm.copy()
    height[50] = np.nan
    bad = Indentation(
        depth_mm=1.0, tip_radius_mm=3.0, radius_mm=good.radius_mm, height_mm=height,
        contact_radius_mm=good.contact_radius_mm, force_n=0.0,
    )  # fmt: skip
    with pytest.raises(InputError, match="not finite"):
        trace_scene(SCENE, np.array([[10.0, 10.0]]), [bad])


def test_pairs_of_a_wrong_shape_are_refused():
    with pytest.raises(InputError, match="pairs"):
        trace_scene(SCENE, np.zeros((1, 2)), [None], pairs=np.ones((2, 1), dtype=bool))


def test_unknown_accuracy_and_single_replicates_are_refused():
    with pytest.raises(InputError, match="draft, score, standard"):
        accuracy_of("best")
    with pytest.raises(InputError, match="2 or more"):
        accuracy_of(Accuracy(replicates=1))


@pytest.mark.parametrize("presses", [np.zeros(3), np.zeros((2, 2)), np.zeros((1, 1, 1, 3))])
def test_presses_of_a_wrong_shape_are_refused(presses):
    with pytest.raises(InputError, match="presses"):
        trace(None, presses)


def test_two_tips_whose_dimples_overlap_are_out_of_scope():
    dimples = [[compact_dimple(2.0), compact_dimple(2.0)]]
    with pytest.raises(ModelScopeError, match=r"tips 6\.00 mm apart"):
        trace_scene(SCENE, np.array([[[8.0, 10.0], [14.0, 10.0]]]), dimples)


@pytest.mark.parametrize("wanted", [0.0, 1.0, -0.1, float("nan")])
def test_a_relative_error_that_makes_no_sense_is_refused(wanted):
    with pytest.raises(InputError, match="relative error"):
        trace_scene(SCENE, np.zeros((1, 2)), [None], accuracy=wanted)


def test_a_profile_per_state_must_match_the_states():
    with pytest.raises(InputError, match="1 indentations for 2 states"):
        trace(Draft.of(preset("piacenza2017-pair")), np.zeros((2, 3)), profile=[None])
