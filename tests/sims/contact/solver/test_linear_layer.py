"""The tests' integral equation against published closed forms, before it judges anything."""

from __future__ import annotations

import numpy as np
import pytest

from tests.sims.contact.solver.linear_layer import layer_force

THICK = 1e3


def flat(radius: np.ndarray) -> np.ndarray:
    return np.zeros_like(radius)


def test_a_flat_punch_on_a_half_space_has_boussinesqs_force() -> None:
    force, _ = layer_force(0.01, flat, THICK, 0.49, radius=1.0)
    # a layer of 1000 radii adds 1.1 radii over its thickness
    assert force == pytest.approx(2.0 * 0.01 / (1.0 - 0.49**2), rel=0.0012)


@pytest.mark.parametrize(("layer", "stiffening"), [(5.0, 1.281), (2.5, 1.683)])
def test_a_flat_punch_on_a_bonded_layer_has_the_tabulated_force(layer: float, stiffening: float) -> None:
    force, _ = layer_force(0.01, flat, layer, 0.5, radius=1.0)
    # Hayes et al. 1972, J. Biomech. 5, table 1: a/h = 0.2 and 0.4 for an incompressible layer, three decimals
    assert force / (2.0 * 0.01 / 0.75) == pytest.approx(stiffening, abs=0.001)


def test_a_cone_on_a_half_space_has_sneddons_force_and_radius() -> None:
    cotangent = 0.2
    force, radius = layer_force(0.1, lambda r: np.full_like(r, cotangent), THICK, 0.49)
    assert force == pytest.approx(2.0 / np.pi * 0.1**2 / cotangent / (1.0 - 0.49**2), rel=0.001)
    assert radius == pytest.approx(2.0 / np.pi * 0.1 / cotangent, rel=0.001)


@pytest.mark.parametrize("depth", [0.01, 0.04])
def test_a_parabola_on_a_bonded_layer_has_dimitriadis_force(depth: float) -> None:
    chi = np.sqrt(depth) / (8.0 / 3.0)
    series = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    force, _ = layer_force(depth, lambda r: r, 8.0 / 3.0, 0.5)
    # their series is truncated; at chi = 0.075 the next term is of the order of 1e-3
    assert force == pytest.approx(16.0 / 9.0 * depth**1.5 * series, rel=1e-3)
