"""The field beside a curve of revolution: together they are the pad's surface, up to the grid."""

import numpy as np
import pytest

from design.errors import InputError, ModelScopeError
from design.preset import preset
from sims.contact import indent
from sims.contact.indentation import solved_press
from sims.contact.pad_surface import curve_height_mm, pad_surface
from sims.optics.scene.lower import scene_of
from sims.optics.scene.smooth_field import smooth_field, sum_of_fields
from sims.optics.surface.curves import OUTER_R, TAIL_MM, stack_surfaces
from sims.optics.surface.wall_correction import tail_height_mm, wall_field
from sims.optics.tracing import correction_fields

PAD = preset("piacenza2017-pad")
SCENE = scene_of(PAD)
GRID = (np.arange(0.05, 32, 0.1)[:, None], np.arange(0.05, 32, 0.1)[None, :])
POINTS = np.broadcast_arrays(*GRID)
PRESSES = [((7.0, 8.0), 1.0), ((7.0, 8.0), 3.0), ((16.0, 6.0), 1.0), ((16.0, 6.0), 3.0)]


def exact_mm(at, depth):
    surfaces = stack_surfaces([indent(PAD, depth)], np.array([at]), SCENE)
    radius = np.hypot(GRID[0] - at[0], GRID[1] - at[1])
    return pad_surface(PAD, depth, at).wall_height_mm(*GRID) - tail_height_mm(surfaces, 0, radius), radius


@pytest.mark.parametrize(("at", "depth"), PRESSES)
def test_the_field_adds_what_the_walls_add_to_a_few_micrometres(at, depth):
    field = correction_fields(PAD, np.array([[*at, depth]]))[0]
    exact, radius = exact_mm(at, depth)
    outside = radius > indent(PAD, depth).contact_radius_mm
    error = (field.height_mm(*POINTS) - exact)[outside]
    # the wall model's own error is 10 to 18 um rms to 3 mm (docs/validation/walls.md): a fifth of it is small beside it
    assert np.sqrt(np.mean(error**2)) < 2e-3
    assert np.abs(error).max() < 0.3 * np.abs(exact).max()


@pytest.mark.parametrize(("at", "depth"), [PRESSES[1], PRESSES[3]])
def test_a_finer_grid_comes_closer(at, depth):
    exact, _ = exact_mm(at, depth)
    surface = pad_surface(PAD, depth, at)
    errors = []
    for spacing in (1.0, 0.5, 0.25):
        field = wall_field(surface.wall_height_mm, indent(PAD, depth), at, SCENE, spacing)
        errors.append(np.sqrt(np.mean((field.height_mm(*POINTS) - exact) ** 2)))
    # the surface has bounded second derivatives: second order, more where it is smoother
    assert errors[0] > 1.8 * errors[1] > 1.8 * 3.5 * errors[2]


@pytest.mark.parametrize(("at", "depth"), PRESSES)
def test_what_the_walls_add_is_zero_inside_the_contact(at, depth):
    added, radius = (
        pad_surface(PAD, depth, at).wall_height_mm(*GRID),
        np.hypot(GRID[0] - at[0], GRID[1] - at[1]),
    )
    assert (added[radius <= indent(PAD, depth).contact_radius_mm] == 0.0).all()
    assert np.abs(added).max() > 5e-3 * depth


@pytest.mark.parametrize(("at", "depth"), PRESSES)
def test_what_the_walls_add_has_no_kink_at_the_contact_edge(at, depth):
    edge = indent(PAD, depth).contact_radius_mm
    surface = pad_surface(PAD, depth, at)
    for angle in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        radius = edge + np.array([0.0, 0.5e-3, 1e-3])
        added = surface.wall_height_mm(at[0] + radius * np.cos(angle), at[1] + radius * np.sin(angle))
        # at most 0.15 mm set in as 3 t² over 0.6 mm: slope over the first micrometre 2 * 0.15 * 3 * 1e-3 / 0.36
        assert np.abs(np.diff(added)).max() / 0.5e-3 < 2.5e-3 * depth


def test_away_from_the_contact_it_is_the_pads_surface_over_the_centred_one():
    at, depth = (7.0, 8.0), 2.0
    surface = pad_surface(PAD, depth, at)
    radius = np.hypot(GRID[0] - at[0], GRID[1] - at[1])
    away = radius > indent(PAD, depth).contact_radius_mm + 0.6
    added = surface.height_mm(*GRID) - curve_height_mm(surface.press, radius)
    assert np.abs(surface.wall_height_mm(*GRID) - added)[away].max() < 1e-14  # rounding


def test_the_tail_of_a_curve_is_taken_away():
    # the round pad's whole curve ends in a slope at its wall, 18 mm from the axis: its tail reaches into the corners
    curve, at = solved_press(PAD).round_pad_at(3.0), (16.0, 16.0)
    field = wall_field(lambda x, y: np.zeros(np.broadcast(x, y).shape), curve, at, SCENE)
    surfaces = stack_surfaces([curve], np.array([at]), SCENE)
    start = surfaces.press[0, OUTER_R] - TAIL_MM
    assert start == pytest.approx(curve.radius_mm[-1])
    radius = np.array([start - 0.1, start, start + 1.0, start + TAIL_MM, start + TAIL_MM + 1])
    tail = tail_height_mm(surfaces, 0, radius)
    assert tail[[0, 1, 3, 4]] == pytest.approx([0.0, 0.0, 0.0, 0.0], abs=1e-15)
    # cubic from slope s to flat over 4 mm: s t (1 - t / 4)²; s is that of the curve's last points
    slope = np.diff(curve.height_mm[-2:])[0] / np.diff(curve.radius_mm[-2:])[0]
    assert tail[2] == pytest.approx(slope * 0.75**2, rel=0.05)
    corner = 16.0 + (start + 1.0) / np.sqrt(2)
    assert field.height_mm(np.array([corner]), np.array([corner]))[0] == pytest.approx(-tail[2], abs=5e-3)


def test_a_curve_that_runs_out_has_next_to_no_tail():
    curve = indent(PAD, 3.0)
    surfaces = stack_surfaces([curve], np.array([[16.0, 16.0]]), SCENE)
    assert np.abs(tail_height_mm(surfaces, 0, np.linspace(16.0, 30.0, 200))).max() < 1e-3


def test_mirrored_presses_have_mirrored_fields():
    one, other = correction_fields(PAD, np.array([[7.0, 8.0, 2.0], [25.0, 8.0, 2.0]]))
    assert np.abs(one.nodes[..., 0] - other.nodes[::-1, :, 0]).max() < 1e-12
    assert np.abs(one.nodes[..., 1] + other.nodes[::-1, :, 1]).max() < 1e-11


def test_an_untouched_state_has_no_field_and_equal_presses_share_one():
    fields = correction_fields(PAD, np.array([[7.0, 8.0, 0.0], [7.0, 8.0, 1.0], [7.0, 8.0, 1.0]]))
    assert fields[0] is None
    assert fields[1].nodes is not None
    assert (fields[1].nodes == fields[2].nodes).all()


def test_several_tips_add_up():
    one, other, both = correction_fields(
        PAD,
        np.array(
            [
                [[7.0, 8.0, 1.0], [np.nan] * 3],
                [[np.nan] * 3, [24.0, 20.0, 2.0]],
                [[7.0, 8.0, 1.0], [24.0, 20.0, 2.0]],
            ]
        ),
    )
    assert np.abs(one.nodes + other.nodes - both.nodes).max() < 1e-15


def test_a_press_that_the_wall_model_does_not_cover_is_out_of_scope():
    with pytest.raises(ModelScopeError, match="west wall"):
        correction_fields(PAD, np.array([[4.0, 16.0, 1.0]]))


def test_fields_on_different_grids_do_not_add():
    fields = [smooth_field(lambda x, y: 0 * (x + y), 8.0, 8.0, spacing) for spacing in (1.0, 0.5)]
    with pytest.raises(InputError, match="2 different grids"):
        sum_of_fields(fields)
