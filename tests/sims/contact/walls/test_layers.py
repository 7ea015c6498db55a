"""Linear layers: closed forms, volume, walls, symmetry."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0, jv

from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.walls import (
    LOAD_RADII,
    BlockLayer,
    QuadraticAxis,
    block_layer,
    graded_ticks,
    load_fields,
    surroundings,
    wide_fields,
)

PAD = (32 / 3, 32 / 3)


def simpson(ticks: np.ndarray) -> np.ndarray:
    """Weights of the nodes of quadratic elements, exact for them."""
    return QuadraticAxis(ticks).load(np.ones_like)


def test_integrals_along_an_axis_are_exact_for_its_polynomials() -> None:
    axis = QuadraticAxis(graded_ticks(2.0, 0.2, 1.5, 0.8))
    squares, lines = axis.nodes**2, axis.nodes
    assert lines[-1] == pytest.approx(2.0)
    assert squares @ axis.matrix("value", "value") @ lines == pytest.approx(2.0**4 / 4)
    assert squares @ axis.matrix("slope", "slope", lambda x: x) @ lines == pytest.approx(2.0 * 2.0**3 / 3)
    assert axis.ticks @ axis.matrix("pressure", "slope") @ squares == pytest.approx(2.0 * 2.0**3 / 3)
    assert axis.load(lambda x: x) @ lines == pytest.approx(2.0**3 / 3)


@pytest.mark.parametrize("layer", [1.3, 3.0, 6.0])
def test_a_wide_layer_answers_as_the_closed_form(layer: float) -> None:
    """Incompressible layer of depth h on a rigid base, pressure p(k) J0(k r) at its top, shear modulus 1:

    u = -p(k) J0(k r) / (2 k) (sinh 2kh - 2kh) / (1 + cosh 2kh + 2 k²h²)    (Johnson 1985, section 5.8, ν = 1/2)
    """

    def moved(radius: float, width: float) -> float:
        def part(k: float) -> float:
            t, x = 2.0 * k * layer, k * width
            stiff = (1.0 - np.exp(-2.0 * t) - 2.0 * t * np.exp(-t)) / (
                1.0 + np.exp(-2.0 * t) + (2.0 + t * t) * np.exp(-t)
            )
            # transform of 5 / (2 π w²) (1 - r²/w²)^(3/2): 15 √(π/2) J_(5/2)(x) / x^(5/2) over 2 π
            load = 15.0 * np.sqrt(np.pi / 2.0) * jv(2.5, x) / x**2.5 / (2.0 * np.pi)
            return -float(load * j0(k * radius) * 0.5 * stiff)

        return quad(part, 1e-9, 60.0 / width, limit=400)[0]

    for field, width in zip(wide_fields(layer), LOAD_RADII, strict=True):
        deepest = moved(0.0, width)
        for radius in (0.0, 0.8, 2.0, 0.8 * layer + 1.0):
            found = float(field.top_at(np.array([radius]))[0])
            assert found == pytest.approx(moved(radius, width), abs=4e-3 * abs(deepest)), (width, radius)


def test_a_round_layer_keeps_its_volume_and_its_wall() -> None:
    for field in load_fields(3.0, 5.0):
        radius = np.linspace(0.0, 5.0, 4001)
        top = field.top_at(radius)
        volume = np.trapezoid(2.0 * np.pi * radius * top, radius)
        assert abs(volume) < 2e-4 * np.trapezoid(2.0 * np.pi * radius * np.abs(top), radius)
        assert field.top_at(np.array([5.0, 7.0])).tolist() == [0.0, 0.0]


def flow_in(block: BlockLayer, moved: np.ndarray) -> float:
    """Volume that four moved walls press in, from a quarter's nodes and the images of the cause."""
    x, y, z = (np.unique(block.wall_nodes[:, axis]) for axis in range(3))
    z = np.append(0.0, z)
    total = 0.0
    for a in range(2):
        for b in range(2):
            for axis, along in ((0, y), (1, x)):
                on_wall = np.flatnonzero(block.wall_nodes[:, axis] == 0.0)
                grid = np.zeros((len(along), len(z)))
                rows = np.searchsorted(along, block.wall_nodes[on_wall, 1 - axis])
                grid[rows, np.searchsorted(z, block.wall_nodes[on_wall, 2])] = moved[a, b, axis, on_wall]
                total += simpson(along[::2]) @ grid @ simpson(z[::2])
    return total


def test_what_the_walls_press_in_raises_the_top() -> None:
    """No divergence against pressure 1: to round-off, whatever the walls do."""
    block = block_layer(3.0, PAD)
    chance = np.random.default_rng(0)
    moved = chance.normal(size=(2, 2, 3, len(block.wall_nodes)))
    # an image's displacement across a middle plane is the mirrored one on it: even causes only
    moved[:] = moved[0, 0]
    moved[:, :, 0, block.wall_nodes[:, 0] == block.wall_nodes[:, 0].max()] = 0.0
    moved[:, :, 1, block.wall_nodes[:, 1] == block.wall_nodes[:, 1].max()] = 0.0
    moved[:, :, :2, (block.wall_nodes[:, 0] == 0.0) & (block.wall_nodes[:, 1] == 0.0)] = 0.0
    half = [nodes[: len(nodes) // 2 + 1] for nodes in (block.x, block.y)]
    weights = [simpson(nodes[::2]) for nodes in half]
    raised = weights[0] @ block.top(moved)[: len(half[0]), : len(half[1])] @ weights[1]
    assert raised == pytest.approx(flow_in(block, moved) / 4.0, abs=1e-9)


@pytest.mark.parametrize("at", [(16 / 3, 16 / 3), (2.0, 16 / 3), (2.0, 2.5)])
def test_a_press_and_what_its_walls_add_is_nothing_at_the_walls(at: tuple[float, float]) -> None:
    walls = surroundings(3.0, 6.0, PAD, at)
    x, y = walls.block.x, walls.block.y
    for unit in np.eye(len(LOAD_RADII)):
        radius = np.hypot(x[:, None] - at[0], y[None, :] - at[1])
        round_pad = np.tensordot(unit, [one.top_at(radius) for one in walls.round_pad], axes=1)
        whole = walls.change(unit, x, y) + round_pad
        assert max(np.abs(side).max() for side in (whole[0], whole[-1], whole[:, 0], whole[:, -1])) < 1e-12
        assert np.abs(whole).max() > 0.01


@pytest.mark.full
def test_walls_far_away_change_nothing_but_that_the_round_one_is_gone() -> None:
    walls = surroundings(1.5, 7.5, (24.0, 24.0), (12.0, 12.0))
    assert np.abs(walls.on_axis).max() < 2e-4
    near = surroundings(1.5, 7.5, (24.0, 24.0), (2.0, 12.0))
    assert np.abs(near.on_axis).min() > 1e-3


def test_mirrored_and_turned_places_have_the_same_walls() -> None:
    x = np.linspace(0.5, 10.0, 12)
    unit = np.array([1.0, -0.5])
    here = surroundings(3.0, 6.0, PAD, (2.0, 4.0)).change(unit, x, x)
    mirrored = surroundings(3.0, 6.0, PAD, (PAD[0] - 2.0, 4.0)).change(unit, (PAD[0] - x)[::-1], x)[::-1]
    turned = surroundings(3.0, 6.0, PAD, (4.0, 2.0)).change(unit, x, x)
    np.testing.assert_allclose(mirrored, here, atol=1e-12)
    np.testing.assert_allclose(turned, here.T, atol=1e-12)


@pytest.mark.parametrize("layer", [1.3, 2.125, 3.0, 6.0])
def test_the_loads_give_the_solved_top_and_nearly_its_force(layer: float) -> None:
    smooth = shipped_library().press(layer)
    shallow = smooth.far.amplitudes(0.1).sum() / 3.0
    # the linear force of incompressible rubber, E = 3 μ; deep presses are not linear near the tip
    assert shallow == pytest.approx(smooth.force_at(0.1), rel=0.1)
    # 13 µm under a tip of 3 mm, at the deepest press
    assert smooth.far.residual.max() < 4.5e-3


@pytest.mark.parametrize("wall", [3.76126389, 4.513516668, 7.5])
@pytest.mark.parametrize("depth", [1 / 3, 1.0, 1.5])
def test_the_linear_layer_tells_what_another_round_wall_does_to_a_solved_press(
    wall: float, depth: float
) -> None:
    """The library solved each of these pads; only one of them is used to tell the other's top."""
    library = shipped_library()
    reference, other = library.press(3.0), library.press(3.0, wall)
    fields = load_fields(3.0, other.wall_radius)
    own = load_fields(3.0, reference.wall_radius)
    zero = np.zeros(1)
    inner = depth
    for _ in range(20):
        loads = reference.far.amplitudes(inner)
        inner = depth + sum(
            q * (a.top_at(zero) - b.top_at(zero))[0] for q, a, b in zip(loads, fields, own, strict=True)
        )
    radius = np.linspace(1.6, min(wall, reference.wall_radius) - 0.1, 40)
    curves = [
        (press.curve_at(at), press) for press, at in ((reference, inner), (other, depth), (reference, depth))
    ]
    tops = [np.interp(radius, curve.radius, curve.height) for curve, _ in curves]
    change = sum(
        q * (a.top_at(radius) - b.top_at(radius)) for q, a, b in zip(loads, fields, own, strict=True)
    )
    error, before = tops[0] + change - tops[1], tops[2] - tops[1]
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(before**2)) + 2e-4
    force = reference.force_at(inner) / other.force_at(depth)
    assert force == pytest.approx(1.0, abs=0.02)
