"""Ray pictures: paths belong to the light they are drawn for, and lie where the numbers say."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of
from optopad.sims.optics.engine.trace_states import CLASS_NAMES
from optopad.sims.optics.paths import FATES, LightPath
from optopad.sims.plots.ray_sheet import ray_sheet
from optopad.sims.plots.rays import (
    Cut,
    cut_across,
    cut_of_pair,
    cut_through,
    plot_ray_plan,
    plot_ray_section,
)
from optopad.sims.plots.style import plain_style, svg_text
from optopad.sims.press import Indentation
from optopad.sims.rays import FEWEST, KINDS, LOST, RayChoice, RayState, kind_of, ray_states

DESIGN = preset("piacenza2017-pair")
CAVITY = cavity_of(DESIGN)
PAIR = (1, 1)
CUT = cut_of_pair(CAVITY, PAIR)
PRESSES = [(10.0, 10.0, 1.0), (10.0, 10.0, 2.5)]


@pytest.fixture(scope="module")
def states() -> tuple[RayState, ...]:
    return ray_states(DESIGN, RayChoice(pairs=(PAIR,), count=12, seed=3), PRESSES)


def cone(depth_mm: float, radius_mm: float = 3.0) -> Indentation:
    """A straight cone as deep at its axis as the press, flat from its rim on."""
    slope = np.linspace(0.0, 1.0, 31)  # close enough for the monotone cubic to be straight
    return Indentation(
        depth_mm=depth_mm,
        tip_radius_mm=3.0,
        radius_mm=np.append(slope * radius_mm, 20.0),
        height_mm=np.append((slope - 1.0) * depth_mm, 0.0),
        contact_radius_mm=1.0,
        force_n=1.0,
    )


def made_up_state(press: tuple[float, float, float], *paths: LightPath, **power: float) -> RayState:
    return RayState(
        press_mm=press,
        indentation=cone(press[2]) if press[2] > 0 else None,
        power={name: np.array([value]) for name, value in power.items()},
        emitters=1,
        paths=paths,
        lost=(),
        lost_by=(),
    )


def made_up_path(fate: str, *places: tuple[float, float, float]) -> LightPath:
    return LightPath(fate=fate, emitter=1, receiver=1, ray=0, places_mm=np.array(places))


def test_every_class_and_loss_of_the_light_models_has_a_kind():
    assert {name for name in (*CLASS_NAMES, *FATES) if kind_of(name).key == "other"} == set()
    assert len({kind.key for kind in KINDS}) == len(KINDS)


def test_paths_run_from_the_emitter_to_the_receiver_of_the_pair(states):
    for state in states:
        for path in state.paths:
            assert (path.emitter, path.receiver) == PAIR
            assert path.places_mm[0, 0] == 0.0
            assert path.places_mm[-1, 0] == pytest.approx(20.0, abs=1e-9)


def test_the_untouched_pad_is_first_and_loses_nothing(states):
    assert [state.press_mm[2] for state in states] == [0.0, 1.0, 2.5]
    assert states[0].indentation is None
    assert states[0].lost == ()


def test_lost_light_is_light_that_arrived_before_the_press(states):
    for state in states[1:]:
        assert state.lost
        assert all(path.receiver != PAIR[1] for path in state.lost)
        assert state.lost_by == (PAIR[1],) * len(state.lost)
        # same ray number, same start: the ray is the one that was found in the untouched pad
        assert {path.places_mm[0, 0] for path in state.lost} == {0.0}


def test_the_number_of_lines_follows_the_root_of_the_power(states):
    untouched, _, deep = states
    drawn = [kind_of(path.fate).key for path in deep.paths]
    share = deep.power_by_kind["direct"] / untouched.power_by_kind["direct"]
    assert 0.05 < share < 0.9  # at 2.5 mm the tip blocks some of the straight light of this pair
    assert drawn.count("direct") == max(FEWEST, round(12 * share**0.5))
    assert [kind_of(path.fate).key for path in untouched.paths].count("direct") == 12


def test_all_losses_are_shown_where_no_receiver_is_asked_for():
    choice = RayChoice(pairs=tuple((0, r) for r in range(3)), count=10, shows_all_losses=True)
    (untouched,) = ray_states(DESIGN, choice, [])
    assert len(untouched.lost) == 10
    assert {kind_of(path.fate) for path in untouched.lost} == {LOST}


def test_power_is_a_share_of_all_emitters_together():
    choice = RayChoice(pairs=tuple((e, r) for e in range(3) for r in range(3)), count=6)
    (untouched,) = ray_states(DESIGN, choice, [])
    assert 0.01 < untouched.total < 0.1  # each LED's receivers see a few per cent of its light
    assert untouched.total == pytest.approx(sum(float(v.sum()) for v in untouched.power.values()) / 3)
    assert {path.emitter for path in untouched.paths} == {0, 1, 2}


def test_equal_seeds_give_equal_paths(states):
    again = ray_states(DESIGN, RayChoice(pairs=(PAIR,), count=12, seed=3), PRESSES)
    for one, other in zip(states, again, strict=True):
        assert [path.ray for path in one.paths] == [path.ray for path in other.paths]
        assert all(
            np.array_equal(a.places_mm, b.places_mm) for a, b in zip(one.lost, other.lost, strict=True)
        )


def rays_of(ax, key: str) -> list[np.ndarray]:
    (found,) = [c for c in ax.collections if isinstance(c, LineCollection) and c.get_gid() == f"rays-{key}"]
    return [np.asarray(segment) for segment in found.get_segments()]


def test_the_section_projects_paths_onto_the_cut():
    cut = Cut(start_mm=(0.0, 0.0), end_mm=(20.0, 20.0), name="along the diagonal")
    path = made_up_path("top", (0, 10, 5), (10, 10, 8), (20, 10, 6))
    ax = plot_ray_section(made_up_state((10, 10, 0), path, top=1e-3), DESIGN, cut=cut)
    (segment,) = rays_of(ax, "top")
    root = 2.0**0.5
    assert segment == pytest.approx(np.array([[5 * root, 5], [10 * root, 8], [15 * root, 6]]))


def test_the_plan_shows_paths_from_above_and_the_contact_circle():
    path = made_up_path("direct", (0, 10, 5), (20, 10.5, 6))
    ax = plot_ray_plan(made_up_state((8, 9, 2), path, direct=1e-3), DESIGN, cut=CUT)
    assert rays_of(ax, "direct")[0] == pytest.approx(np.array([[0, 10], [20, 10.5]]))
    (contact,) = [patch for patch in ax.patches if patch.get_gid() == "contact"]
    around = contact.get_xy() - [8.0, 9.0]
    assert np.hypot(*around.T) == pytest.approx(1.0)  # mm, the contact radius of the cone


@pytest.mark.parametrize(("y_mm", "aside"), [(10.0, 0.0), (11.0, 1.0)])
def test_the_surface_of_the_section_is_the_press_where_the_plane_cuts_it(y_mm, aside):
    ax = plot_ray_section(made_up_state((8.0, y_mm, 2.0), direct=1e-3), DESIGN, cut=CUT)
    (surface,) = [line for line in ax.lines if line.get_gid() == "surface"]
    along, height = surface.get_data()
    assert (along[0], along[-1]) == (0.0, 20.0)
    top = CAVITY.clear_mm
    expected = top - 2.0 + 2.0 * aside / 3.0  # of a cone of rim radius 3 mm
    assert height.min() == pytest.approx(expected)
    assert along[np.argmin(height)] == pytest.approx(8.0)
    assert height[[0, -1]] == pytest.approx(top)


def test_cuts_run_from_wall_to_wall():
    assert (CUT.start_mm, CUT.end_mm) == ((0.0, 10.0), (20.0, 10.0))
    across = cut_across(CAVITY, CAVITY.receivers[0])
    assert across.start_mm == (20.0, CAVITY.receivers[0].along_mm)
    assert across.end_mm == (0.0, CAVITY.receivers[0].along_mm)
    assert cut_through(CAVITY, 7.0, 8.0).end_mm == (20.0, 8.0)
    assert CUT.beside_mm((3.0, 12.5)) == pytest.approx(2.5)
    assert Cut(start_mm=(0, 0), end_mm=(3, 4), name="").along_mm(np.array([3.0, 4.0])) == pytest.approx(5.0)


def test_a_sheet_has_a_row_for_every_press_and_the_same_bytes_each_time(states):
    with plain_style():
        sheets = [
            ray_sheet(states, DESIGN, CUT, title="light", caption="words " * 90, is_of_untouched=True)
            for _ in range(2)
        ]
        assert len(sheets[0].axes) == 2 * len(states)
        first, second = (svg_text(sheet, "rays") for sheet in sheets)
    assert first == second
    assert "untouched light arrives" in first
