"""Bad input is refused by name."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.sims.optics import tracing
from optopad.sims.optics.engine.trace_states import CLASS_NAMES, Accuracy, RawLight, accuracy_of, trace_scene
from optopad.sims.optics.surface.curves import CONTACT_R
from optopad.sims.optics.surface.tops import stack_tops
from optopad.sims.optics.tracing import trace
from optopad.sims.press import Indentation
from tests.oracle.oracle_scenes import dimple, ring_scene, scene_of, shank_press
from tests.oracle.tracer import trace_oracle
from tests.sims.optics.engine.called_kernels import height
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


@pytest.mark.parametrize("wanted", [0.0, 1.0, -0.1, float("nan")])
def test_a_relative_error_that_makes_no_sense_is_refused(wanted):
    with pytest.raises(InputError, match="relative error"):
        trace_scene(SCENE, np.zeros((1, 2)), [None], accuracy=wanted)


def test_a_profile_per_state_must_match_the_states():
    with pytest.raises(InputError, match="1 indentations for 2 states"):
        trace(Draft.of(preset("piacenza2017-pair")), np.zeros((2, 3)), profile=[None])


CENTRE = np.array([[14.0, 17.0]])


def punch(depth_mm: float) -> Indentation:
    """A flat punch of 3 mm radius, edge of 0.3 mm touched over 60 degrees, and a cubic skirt."""
    angle = np.linspace(0.0, math.pi / 3.0, 12)
    edge = np.column_stack([2.7 + 0.3 * np.sin(angle), 0.3 * (1.0 - np.cos(angle)) - depth_mm])
    face = np.column_stack([np.linspace(0.0, 2.7, 30)[:-1], np.full(29, -depth_mm)])
    share = np.linspace(0.0, 1.0, 300)[1:]
    left = depth_mm - 0.15
    skirt = np.column_stack([edge[-1, 0] + 3.0 * left / math.sqrt(3.0) * share, -left * (1.0 - share) ** 3])
    curve = np.vstack([face, edge, skirt])
    return Indentation(
        depth_mm=depth_mm,
        tip_radius_mm=3.0,
        radius_mm=curve[:, 0],
        height_mm=curve[:, 1],
        contact_radius_mm=float(edge[-1, 0]),
        force_n=1.0,
        is_hemisphere=False,
    )


@pytest.mark.parametrize(
    ("press", "limit_mm"),
    [(dimple(0.3), 2e-4), (dimple(2.0, 0.05), 1e-3), (punch(1.0), 1e-3), (punch(3.0), 2e-3)],
)
def test_the_table_follows_the_curve_of_any_tip(press: Indentation, limit_mm: float) -> None:
    other = replace(press, is_hemisphere=False)
    row = stack_tops([other], CENTRE, ring_scene()).rows[0]
    inside = (press.radius_mm > 0.01) & (press.radius_mm < 9.0)
    found = [height(r * r, row) - 8.0 for r in press.radius_mm[inside]]
    # a cell of the table is 0.03 to 0.06 mm wide here: an eighth of its square over the edge's 0.3 mm radius
    # is 1.5 um, over the tip's 3 mm 0.15 um
    assert np.abs(found - press.height_mm[inside]).max() < limit_mm
    assert row[CONTACT_R] == pytest.approx(press.contact_radius_mm, abs=0.01)


# Same points, other table: cells of 0.04 mm instead of 0.01 mm beside the contact. Along a wetted shank the
# points that make it single valued move by a thirtieth of its 0.5 mm, in one table from the equator on.
@pytest.mark.parametrize(
    ("press", "share"), [(dimple(0.5, 0.02), 1e-5), (dimple(2.0, 0.05), 1e-5), (shank_press(), 1e-3)]
)
def test_a_sphere_given_as_a_curve_has_the_light_of_the_sphere(press: Indentation, share: float) -> None:
    sphere, curve = (
        trace_scene(ring_scene(), CENTRE, [replace(press, is_hemisphere=flag)], seed=7)
        for flag in (True, False)
    )
    change = (sphere.flux - curve.flux).sum(axis=0)
    assert np.abs(change).max() <= share * sphere.flux.sum(axis=0).max()


@pytest.mark.full
@pytest.mark.parametrize("reflectance", [0.0, 0.5])
@pytest.mark.parametrize("depth_mm", [0.4, 1.5, 3.0])
def test_light_under_a_flat_punch_is_the_oracles(depth_mm: float, reflectance: float) -> None:
    scene, count = ring_scene(tip_reflectance=reflectance), 2_000_000
    oracle = trace_oracle(scene, CENTRE, [punch(depth_mm)], rays=count, seed=2017)
    fast = trace_scene(scene, CENTRE, [punch(depth_mm)], seed=7)
    pooled = (fast.standard_error**2).mean()
    theirs, ours = oracle.without_crossing[0], fast.flux.sum(axis=0)[0]
    bright = ours * count >= 25.0
    pulls = ((ours - theirs) / np.sqrt(ours / count + pooled))[bright]
    # an oracle pair counts rays, so its variance is flux / rays; chi-square at 1e-4, 5 errors for the worst
    assert bright.sum() > 40
    assert (pulls**2).sum() < chi2.ppf(1.0 - 1e-4, bright.sum())
    assert np.abs(pulls).max() < 5.0


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
    assert centres.tolist() == [[9.0, 8.0], [5.0, 5.0], [0.0, 0.0]]
    assert indentations == [DIMPLE, DIMPLE, None]
    assert light.presses.tolist() == [[9.0, 8.0, 1.0], [5.0, 5.0, 1.0], [0.0, 0.0, 0.0]]


def test_a_tip_that_is_not_finite_is_refused_by_its_state(asked):
    presses = np.array([[[9.0, 8.0, 1.0], NONE], [[9.0, np.nan, 1.0], [5.0, 5.0, 1.0]]])
    with pytest.raises(InputError, match="state 1 is not finite"):
        tracing.trace(Pad.of(PAD), presses, DIMPLE)
    assert asked == []
