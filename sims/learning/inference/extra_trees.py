"""Estimate (x, y, depth) with a forest of regression trees, stored as flat arrays.

At each node, if the node's feature is at most `threshold`, go to the next node, otherwise to node `other`. A leaf has
the feature -1, and its `other` is an index into `leaf_mm`. The estimate is the mean over the trees' leaves; the spread
over the trees is the raw deviation. All trees are descended together, one step at a time. Source: Geurts, Ernst and
Wehenkel, Extremely randomized trees, Machine Learning 63 (2006).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.sims.learning.inference.header import ModelHeader
from optopad.sims.learning.inference.touch_model import (
    Arrays,
    FeatureScaling,
    Prediction,
    SigmaTable,
    TouchSvm,
    checked_signals,
    prediction_of,
    scaling_of_arrays,
    sigma_table_of_arrays,
    taken,
    taken_whole,
    touch_svm_of_arrays,
)

FRAMES_AT_ONCE = 1_000
LEAST_SPREAD_MM = 0.05
"""Least raw deviation [mm]: trees that all end at samples of one location agree exactly, but still have errors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Forest:
    """Regression trees for x, y, depth, one after another in shared arrays.

    Attributes
    ----------
    roots : (tree,) number of each tree's first node
    feature : (node,) feature of the split; -1 at a leaf
    threshold : (node,) threshold of the split, in units of the feature
    other : (node,) next node if the feature is above the threshold; at a leaf, its index in `leaf_mm`
    leaf_mm : (leaf, 3) estimated x, y, depth [mm]
    """

    roots: NDArray[np.int32]
    feature: NDArray[np.int16]
    threshold: NDArray[np.float32]
    other: NDArray[np.int32]
    leaf_mm: NDArray[np.float32]

    def leaves_mm(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Each tree's estimates of x, y, depth (n, tree, 3) [mm] from features (n, feature)."""
        node = np.broadcast_to(self.roots, (len(features), len(self.roots))).copy()
        row = np.arange(len(features))[:, None]
        while True:
            asked = self.feature[node]
            is_inner = asked >= 0
            if not is_inner.any():
                return np.asarray(self.leaf_mm[self.other[node]])
            is_low = features[row, asked] <= self.threshold[node]
            node = np.where(is_inner, np.where(is_low, node + 1, self.other[node]), node)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The forest's arrays, by their names in a model file."""
        return {
            "forest_roots": self.roots,
            "forest_feature": self.feature,
            "forest_threshold": self.threshold,
            "forest_other": self.other,
            "forest_leaf_mm": self.leaf_mm,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class ExtraTreesModel:
    """A touch classifier, and a forest of trees that estimates x, y, depth and their deviations.

    Attributes
    ----------
    header : description of the model and its training data
    touch : touch classifier
    scaling : scaling of the features of the trees
    forest : the trees
    sigma : factors from the trees' raw deviation to the standard deviation, by depth
    """

    header: ModelHeader
    touch: TouchSvm
    scaling: FeatureScaling
    forest: Forest
    sigma: SigmaTable

    def predict(self, signals: FloatArray) -> Prediction:
        """Predictions for frames (n, pair) [counts]."""
        signals = checked_signals(self.header, signals)
        press_mm, spread_mm = self.press_and_spread_mm(signals)
        sigma_mm = self.sigma.sigma_mm(press_mm[:, 2], spread_mm)
        return prediction_of(self.header, self.touch.score(signals), press_mm, sigma_mm)

    def press_and_spread_mm(self, signals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean x, y, depth (n, 3) over the trees, and their raw deviations (n, 3) [mm].

        The raw deviation is the standard deviation over the trees, with `LEAST_SPREAD_MM` added in quadrature.
        """
        features = self.scaling.features(signals).astype(np.float32)
        press_mm, spread_mm = np.empty((2, len(features), 3))
        for start in range(0, len(features), FRAMES_AT_ONCE):
            rows = slice(start, start + FRAMES_AT_ONCE)
            said = self.forest.leaves_mm(features[rows]).astype(np.float64)
            press_mm[rows], spread_mm[rows] = said.mean(axis=1), np.hypot(said.std(axis=1), LEAST_SPREAD_MM)
        return press_mm, spread_mm

    def arrays(self) -> Arrays:
        """The model's arrays, by their names in its file."""
        return self.touch.arrays() | self.scaling.arrays("trees") | self.forest.arrays() | self.sigma.arrays()


def extra_trees_of_arrays(header: ModelHeader, arrays: Arrays) -> ExtraTreesModel:
    """Make the model from its header and arrays in a file; raises `InputError` if the arrays are inconsistent."""
    pairs = len(header.untouched_counts)
    scaling = scaling_of_arrays(arrays, "trees", pairs)
    return ExtraTreesModel(
        header=header,
        touch=touch_svm_of_arrays(arrays, pairs),
        scaling=scaling,
        forest=_forest(arrays, len(scaling.kept)),
        sigma=sigma_table_of_arrays(arrays),
    )


def _forest(arrays: Arrays, features: int) -> Forest:
    """A forest from a file's arrays. Every step must go to a later node, so that every path ends."""
    feature = taken_whole(arrays, "forest_feature", (None,))
    other = taken_whole(arrays, "forest_other", feature.shape)
    roots = taken_whole(arrays, "forest_roots", (None,))
    leaf_mm = taken(arrays, "forest_leaf_mm", (None, 3)).astype(np.float32)
    inner = feature >= 0
    numbers = np.arange(len(feature))
    if (
        not (len(roots) and len(feature))
        or inner[-1]
        or feature.max() >= features
        or (other[inner] <= numbers[inner]).any()
        or (other[inner] >= len(feature)).any()
        or other[~inner].min() < 0
        or other[~inner].max() >= len(leaf_mm)
        or roots.min() < 0
        or roots.max() >= len(feature)
    ):
        raise InputError("forest_other: its trees lead to nodes or leaves that do not exist")
    return Forest(
        roots=roots,
        feature=feature.astype(np.int16),
        threshold=taken(arrays, "forest_threshold", feature.shape).astype(np.float32),
        other=other,
        leaf_mm=leaf_mm,
    )
