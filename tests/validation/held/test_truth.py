"""Stored presses of objects: closed forms and trends that they must obey."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from tests.validation.contact.pad_oracle import TIP_RADIUS_MM, pad_press
from tests.validation.held.object_cases import OBJECT_CASES
from tests.validation.held.truth import CASES
from tests.validation.held.truth_file import read_truth

TRUTH = {case: {(row.depth_mm, row.quantity): row for row in rows} for case, rows in read_truth().items()}
WIDE = "long cylinder, radius 5, walls 160 apart"
NARROW = "long cylinder, radius 5"


def of(case: str, quantity: str) -> FloatArray:
    """(depth,) values of a quantity in the order of the depths."""
    return np.array([row.value for (_, name), row in TRUTH[case].items() if name == quantity])


def linear_force(
    radius: float, depth: float, layer: float = 9.0, n: int = 4096, length: float = 160.0
) -> float:
    """Force per length over E of a long cylinder on a wide linear incompressible layer, bonded to a rigid floor.

    A pressure cos(qx) lowers the top by C(q) cos(qx), C = 3/(2 E q) (sinh k cosh k - k)/(cosh² k + k²), k = q layer.
    """
    x = (np.arange(n) - n // 2) * length / n
    k = np.clip(np.abs(2.0 * np.pi * np.fft.fftfreq(n, length / n)) * layer, 1e-9, 40.0)
    wave = np.maximum(np.abs(2.0 * np.pi * np.fft.fftfreq(n, length / n)), 1e-9 / layer)
    answer = 1.5 / wave * (np.sinh(k) * np.cosh(k) - k) / (np.cosh(k) ** 2 + k**2)
    answer[0] = 0.0
    compliance = np.fft.ifft(answer).real
    on = np.flatnonzero(x**2 < radius * depth)
    while True:
        gap = depth - x[on] ** 2 / (2.0 * radius) - x[on] ** 4 / (8.0 * radius**3)
        pressure = np.linalg.solve(compliance[(on[:, None] - on) % n], gap)
        if pressure.min() > 0.0:
            return float(pressure.sum() * length / n)
        on = on[pressure > 0.0]


def test_every_case_is_stored() -> None:
    assert list(TRUTH) == list(CASES)
    for name, case in CASES.items():
        assert list(dict.fromkeys(depth for depth, _ in TRUTH[name])) == list(case.depths_mm)


def test_a_shallow_long_cylinder_presses_like_on_a_linear_layer() -> None:
    """Strains are a tenth of the contact's half width over the radius; the linear answer falls behind with depth."""
    ratio = of(WIDE, "force/E [mm]")[:3] / [linear_force(5.0, depth) for depth in (0.25, 0.5, 1.0)]
    assert ratio[0] == pytest.approx(1.0, abs=0.01)
    assert ratio[2] == pytest.approx(1.0, abs=0.05)
    assert (np.diff(ratio) > 0.0).all()


def test_walls_stiffen_the_layer_and_raise_the_top() -> None:
    assert (of(NARROW, "force/E [mm]") > of(WIDE, "force/E [mm]")).all()
    for at in ("10", "13"):
        height = f"height at x = {at} mm [mm]"
        assert (of(NARROW, height) > of(WIDE, height)).all()
        assert (of(WIDE, height) > 0.0).all()


@pytest.mark.parametrize("case", TRUTH)
def test_force_and_contact_grow_with_depth(case: str) -> None:
    depths = sorted({depth for depth, _ in TRUTH[case]})
    for name in {name for _, name in TRUTH[case] if name.startswith(("force", "contact half width along y"))}:
        values = of(case, name)
        assert (np.diff(values) > 0.0).all()
        assert values[0] > 0.0
        if name.startswith("force"):  # a contact that grows: more than in proportion, but for a flat punch
            shares = values / depths
            assert all(later > 0.97 * earlier for earlier, later in pairwise(shares))


@pytest.mark.parametrize("case", TRUTH)
def test_meshes_agree(case: str) -> None:
    for (depth_mm, name), row in TRUTH[case].items():
        if name.startswith("force"):
            assert abs(row.mesh_error) < 0.02 * row.value
        elif name.startswith("height") and "edge + 0.5" not in name:
            assert abs(row.mesh_error) < 0.02 * depth_mm, name


def test_the_ball_presses_like_the_stored_block() -> None:
    """Another mesh, of elements of 0.9 mm, and a shank that does not touch yet."""
    for depth_mm, force in zip((1.0, 2.0), of("ball, radius 3", "force/E [mm2]"), strict=True):
        stored = pad_press("pad middle", depth_mm).force * TIP_RADIUS_MM**2
        assert force == pytest.approx(stored, rel=0.01)


@pytest.mark.parametrize("case", OBJECT_CASES)
def test_gradients_of_the_distance_are_its_derivatives(case: str) -> None:
    distance = OBJECT_CASES[case].thing.distance
    places = np.random.default_rng(3).uniform([-7.0, -7.0, -2.0], [7.0, 7.0, 3.0], (300, 3))
    places = places[distance(places)[0] > -0.4]
    _, normal, hessian = distance(places)
    step = 1e-5
    for axis in range(3):
        ahead, behind = (distance(places + sign * step * np.eye(3)[axis]) for sign in (1, -1))
        # central differences: error step² over distance²
        assert (ahead[0] - behind[0]) / (2.0 * step) == pytest.approx(normal[:, axis], abs=1e-6)
        bent = np.abs((ahead[1] - behind[1]) / (2.0 * step) - hessian[:, axis]).max(axis=-1)
        assert np.quantile(bent, 0.97) < 1e-6  # it jumps where two sides meet
    assert distance(np.zeros((1, 3)))[0] == pytest.approx(0.0, abs=1e-12)
