"""The r-z mesh covers the layer exactly and is graded as described."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.contact.mesh import FINE_RADIUS, GROWTH, graded_spacing, radial_mesh


def signed_areas(mesh_nodes: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (mesh_nodes[triangles[:, k]] for k in range(3))
    return np.asarray(0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]))


@pytest.mark.parametrize(("layer", "spacing"), [(1.3, 0.2), (3.0, 0.1), (6.0, 0.15)])
def test_triangles_fill_the_layer_without_overlap(layer: float, spacing: float) -> None:
    mesh = radial_mesh(layer, 16 / 3, spacing)
    areas = signed_areas(mesh.nodes, mesh.triangles)
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(layer * 16 / 3, rel=1e-12)


def test_every_node_belongs_to_a_triangle_and_none_is_doubled() -> None:
    mesh = radial_mesh(3.0, 16 / 3, 0.15)
    assert np.unique(mesh.triangles).size == len(mesh.nodes)
    assert len(np.unique(np.round(mesh.nodes, 9), axis=0)) == len(mesh.nodes)


def test_top_runs_from_the_axis_to_the_bonded_wall_at_height_zero() -> None:
    mesh = radial_mesh(3.0, 16 / 3, 0.15)
    radius, height = mesh.nodes[mesh.top].T
    assert radius[0] == 0.0
    assert radius[-1] == pytest.approx(16 / 3)
    assert np.all(np.diff(radius) > 0)
    np.testing.assert_allclose(height, 0.0, atol=1e-12)
    assert mesh.is_bonded[mesh.top].tolist() == [False] * (len(mesh.top) - 1) + [True]


def test_spacing_is_even_under_the_tip_and_grows_by_a_fixed_ratio_outside() -> None:
    steps = np.diff(graded_spacing(16 / 3, FINE_RADIUS, 0.1, 2 / 3))
    fine = round(FINE_RADIUS / 0.1)
    np.testing.assert_allclose(steps[:fine], FINE_RADIUS / fine, rtol=1e-12)
    growing = steps[fine:]
    ratios = growing[1:] / growing[:-1]
    assert ratios.max() <= GROWTH + 1e-9
    assert ratios.min() >= 1.0 - 1e-9


def test_bottom_and_wall_are_bonded_and_nothing_else() -> None:
    mesh = radial_mesh(3.0, 16 / 3, 0.2)
    radius, height = mesh.nodes.T
    np.testing.assert_array_equal(mesh.is_bonded, (height < -3.0 + 1e-9) | (radius > 16 / 3 - 1e-9))
