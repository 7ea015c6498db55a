"""Trees learn a made-up pad better than the paper's learner, and answer with numpy as with scikit-learn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sklearn.ensemble import ExtraTreesRegressor

from optopad.design.errors import InputError
from optopad.sims.learning.inference.model_file import load_model, save_model
from optopad.sims.learning.inference.touch_model import SigmaTable
from optopad.sims.learning.learners import LEARNERS, QUICK, flat_forest
from optopad.sims.learning.touch_fit import sigma_table
from tests.sims.learning.pressed_pad import grid_mm, made_up_data, random_places_mm, require_places_found

SMALL = replace(QUICK, fit_samples=500, tree_samples=2_000, trees=15)


@pytest.fixture(scope="module")
def test_set():
    return made_up_data(random_places_mm(40), seed=77, role="test", sets=2)


@pytest.fixture(scope="module")
def model():
    return LEARNERS["extra-trees"](made_up_data(grid_mm(11), sets=2), seed=1, settings=SMALL)


def test_random_places_are_found_to_half_the_grids_step(model, test_set):
    require_places_found(model, test_set)


def test_touch_is_told_from_half_a_millimetre_and_not_above_the_surface(model, test_set):
    found = model.predict(test_set.features().astype(float))
    depth_mm = test_set.press_mm[:, 2]
    assert found.is_touched[depth_mm >= 0.5].mean() > 0.95
    assert found.is_touched[depth_mm < 0.0].mean() < 0.05


def test_deviations_cover_the_errors_and_are_no_larger_than_a_few_of_them(model, test_set):
    touched = test_set.press_mm[:, 2] >= 1.0
    found = model.predict(test_set.features().astype(float)[touched])
    scaled = (found.press_mm - test_set.press_mm[touched]) / found.sigma_mm
    # held-out locations are harder than random ones: errors of half a deviation are the cautious side
    assert 0.15 < np.sqrt(np.mean(scaled**2)) < 1.3


def test_the_saved_model_answers_the_same(model, test_set, tmp_path):
    save_model(tmp_path / "a.optomodel", model)
    loaded = load_model(tmp_path / "a.optomodel")
    signals = test_set.features().astype(float)[:40]
    before, after = model.predict(signals), loaded.predict(signals)
    assert np.array_equal(before.press_mm, after.press_mm)
    assert np.array_equal(before.sigma_mm, after.sigma_mm)
    assert loaded.header.kind == "extra-trees"


def test_one_frame_at_a_time_answers_as_all_at_once(model, test_set):
    signals = test_set.features().astype(float)[:5]
    alone = np.concatenate([model.predict(signals[k : k + 1]).press_mm for k in range(5)])
    # sums of a matrix product run in another order for one row: single precision, values of 30 mm
    assert np.abs(alone - model.predict(signals).press_mm).max() < 1e-4


def test_a_flat_forest_says_what_scikit_learns_says():
    rng = np.random.default_rng(2)
    features = rng.integers(0, 40, size=(500, 7)).astype(
        np.float32
    )  # whole counts: thresholds fall on them often
    targets = rng.normal(size=(500, 3))
    grown = ExtraTreesRegressor(n_estimators=5, random_state=0).fit(features, targets)
    flat = flat_forest([one.tree_ for one in grown.estimators_], np.array([1.0, 2.0, 4.0]))
    asked = rng.integers(0, 40, size=(200, 7)).astype(np.float32)
    said = flat.leaves_mm(asked).mean(axis=1) / np.array([1.0, 2.0, 4.0])
    # leaves are kept in single precision, values below 4
    assert np.abs(said - grown.predict(asked)).max() < 1e-6


def test_a_forest_that_leads_in_circles_is_refused(tmp_path):
    model = LEARNERS["extra-trees"](made_up_data(grid_mm(4), sets=2), settings=replace(SMALL, trees=2))
    other = model.forest.other.copy()
    other[0] = 0
    save_model(tmp_path / "a.optomodel", replace(model, forest=replace(model.forest, other=other)))
    with pytest.raises(InputError, match="forest_other"):
        load_model(tmp_path / "a.optomodel")


def test_trust_is_the_ratio_of_error_to_spread_by_depth():
    rng = np.random.default_rng(3)
    truth = np.column_stack([np.zeros((20_000, 2)), np.linspace(0.0, 5.0, 20_000)])
    spread = np.ones_like(truth) * 0.2
    told = truth + rng.normal(size=truth.shape) * [0.1, 0.4, 0.0]
    table = sigma_table(told, spread, truth)
    # 2,000 samples a depth give a standard deviation to 1.6 %; four of these
    assert table.factor[:, 0] == pytest.approx(0.5, rel=0.065)
    assert table.factor[:, 1] == pytest.approx(2.0, rel=0.065)
    assert table.sigma_mm(np.array([2.0]), spread[:1])[0, :2] == pytest.approx([0.1, 0.4], rel=0.065)


def test_the_table_of_trust_is_linear_between_depths_and_constant_outside():
    table = SigmaTable(depth_mm=np.array([1.0, 3.0]), factor=np.array([[1.0, 1.0, 2.0], [3.0, 1.0, 4.0]]))
    found = table.sigma_mm(np.array([0.0, 2.0, 9.0]), np.full((3, 3), 0.5))
    assert found.tolist() == [[0.5, 0.5, 1.0], [1.0, 0.5, 1.5], [1.5, 0.5, 2.0]]
