"""What varies around a design, where the search begins, and which designs are picked: on made-up figures."""

from __future__ import annotations

import pytest

from optopad.design.errors import DesignError, InputError
from optopad.design.preset import FLOOR_PRESETS, preset
from optopad.design.search.explore import explore
from optopad.design.search.improve import (
    AMPLE_MARGIN,
    CLEAR,
    HEIGHTS,
    KINDS,
    Judged,
    Tried,
    changes_of,
    improvement_space,
    is_sound,
    margin_of,
    picks,
    usable_of,
)
from optopad.design.search.points import first_points, refinements, spread_points, start_of

PAIR, PAD = preset("piacenza2017-pair"), preset("piacenza2017-pad")
RAISED = {HEIGHTS[0]: 1, HEIGHTS[1]: 1, CLEAR: -1}
THICK = PAIR.with_(**{CLEAR: 10.0})


USUAL = {}
"""Spaces with nothing varied or kept by hand: each takes a second."""


def space_of(design, **kind):
    if kind:
        return new_space(design, **kind)
    if design.digest not in USUAL:
        USUAL[design.digest] = new_space(design)
    return USUAL[design.digest]


def new_space(design, *, vary=None, keep=(), more_parts=False, trials=24, seed=0):
    return improvement_space(
        design,
        vary=vary or {},
        keep=keep,
        more_parts=more_parts,
        trials=trials,
        seed=seed,
        figures=("margin", "resolvable_steps"),
    )


def judge(design, limits):
    """Layers more than 2.2 mm above the photodiode are blind; range is used up 2.7 mm from there; low LEDs are dim."""
    gap = design.cavity.clear_thickness_mm - design.receivers.height_mm - 2.2
    dead = max(0.0, 0.8 * gap)
    figures = {
        "deadband_mm": dead,
        "margin": 0.0 if dead else 4.0 - 6.0 * gap,
        "usable_depth_mm": 5.0 if dead else min(5.0, 4.6 + gap),
        "resolvable_steps": 40.0 * design.emitters.height_mm,
    }
    return Judged(
        figures=figures, verdict="DEADBAND" if dead else "CONTIGUOUS", reason="deadband" if dead else ""
    )


def sound_figures(*, margin, place):
    return {"deadband_mm": 0.0, "usable_depth_mm": 5.0, "margin": margin, "location_bound_mm": place}


def found_around(design, tmp_path, **kind):
    space = space_of(design, **kind)
    first = first_points(space, sides=RAISED, short_mm=3.3)
    return space, explore(space, judge, f"sqlite:///{tmp_path / 'study.db'}", first=first)


def test_what_costs_little_varies_by_default():
    paths = [field.path for field in space_of(PAD).fields]
    assert paths == [*HEIGHTS, CLEAR, "gain.target_counts", "layout.0.first"]
    assert "layout.0.parts_per_side" in [field.path for field in space_of(PAD, more_parts=True).fields]
    ohms = PAD.with_(**{"gain.feedback_ohm": 100000.0})
    assert "gain.target_counts" not in [field.path for field in space_of(ohms).fields]


@pytest.mark.parametrize("name", FLOOR_PRESETS)
def test_a_pad_on_a_board_has_fields_that_vary(name):
    paths = [field.path for field in space_of(preset(name)).fields]
    assert CLEAR in paths
    assert not set(HEIGHTS) & set(paths)


@pytest.mark.slow
def test_the_base_is_a_point_of_its_space():
    for design in (PAD, PAIR, THICK, preset("oblong-60x40"), preset("fingertip-16")):
        assert space_of(design).base_parameters() is not None


def test_fields_are_kept_and_varied_as_told():
    space = space_of(PAIR, keep=[CLEAR], vary={"receivers.height_mm": (5.0, 7.0)})
    fields = {field.path: field for field in space.fields}
    assert CLEAR not in fields
    assert (fields["receivers.height_mm"].low, fields["receivers.height_mm"].high) == (5.0, 7.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"vary": {"receivers.heigth_mm": None}}, "receivers.height_mm"),
        ({"vary": {"name": None}}, "number that could"),
        ({"vary": {CLEAR: (8.0, 8.0)}}, "is an empty range"),
        ({"vary": {CLEAR: (8.0, 900.0)}}, "900"),
        ({"keep": ["receivers.heigth_mm"]}, "did you mean receivers.height_mm?"),
        ({"keep": [CLEAR], "vary": {CLEAR: None}}, "given to both"),
        ({"keep": [*HEIGHTS, CLEAR, "gain.target_counts", "layout.0.first"]}, "nothing is left"),
    ],
)
def test_what_cannot_vary_is_refused(given, words):
    with pytest.raises((InputError, DesignError), match=words.replace("?", r"\?")):
        space_of(PAD if "layout.0.first" in given.get("keep", ()) else PAIR, **given)


def test_small_steps_that_gain_come_first_and_the_rest_both_ways():
    space = space_of(PAD)
    sides = {"gain.target_counts": 1, CLEAR: -1}
    changes = [changes_of(space, point) for point in first_points(space, sides=sides, short_mm=2.0)]
    singles = [one for one in changes if len(one) == 1]
    assert list(singles[0]) == ["gain.target_counts"]
    assert list(singles[1]) == [CLEAR]
    base = PAD.cavity.clear_thickness_mm
    assert all(one[CLEAR] < base for one in singles if CLEAR in one)
    ways = {one[HEIGHTS[0]] > PAD.emitters.height_mm for one in singles if HEIGHTS[0] in one}
    assert ways == {True, False}


def test_a_range_that_leaves_the_base_out_is_searched_from_its_nearest_end(tmp_path):
    space, found = found_around(THICK, tmp_path, vary={HEIGHTS[1]: (7.0, 9.0)})
    assert space.base_parameters() is None
    start = start_of(space)
    assert start[HEIGHTS[1]] == 7.0
    assert start[CLEAR] == 10.0
    assert found.tried[0].parameters == start
    wanted = picks(space, found.base, found.tried, "resolvable_steps")
    assert all(one.tried.parameters[HEIGHTS[1]] >= 7.0 for one in wanted)
    assert changes_of(space, start) == {HEIGHTS[1]: 7.0}


def test_a_sound_design_is_bettered_by_what_matters_only():
    base = Judged(figures=sound_figures(margin=12.0, place=0.010), verdict="CONTIGUOUS")
    space = space_of(PAD)
    start = space.base_parameters()

    def tried(number, **figures):
        parameters = start | {HEIGHTS[0]: 5.0 + 0.1 * number}
        judged = Judged(figures=sound_figures(**figures), verdict="CONTIGUOUS")
        return Tried(
            number=number, parameters=parameters, digest="", judged=judged, is_feasible=True, seconds=0.0
        )

    stronger, finer, risky = (
        tried(1, margin=30.0, place=0.010),
        tried(2, margin=11.0, place=0.009),
        tried(3, margin=5.0, place=0.001),
    )
    assert picks(space, base, [stronger, risky], "location_bound_mm") == []
    found = picks(space, base, [stronger, finer, risky], "location_bound_mm")
    assert {one.tried.number for one in found} == {2}
    blind = Judged(figures=sound_figures(margin=12.0, place=None), verdict="CONTIGUOUS")
    assert {one.tried.number for one in picks(space, blind, [finer], "location_bound_mm")} == {2}


def test_the_search_begins_with_single_changes_that_bring_parts_and_surface_together():
    space = space_of(THICK)
    points = first_points(space, sides=RAISED, short_mm=3.3)
    changes = [changes_of(space, point) for point in points]
    assert changes[0] == {HEIGHTS[0]: 5.5, HEIGHTS[1]: 6.5}  # both by 0.15 x 3.3 mm
    assert all(len(one) == 1 or set(one) == set(HEIGHTS) for one in changes)
    assert all(one[CLEAR] < 10.0 for one in changes if CLEAR in one)
    assert all(one[path] > 4.9 for one in changes for path in HEIGHTS if path in one)
    lowered = first_points(space, sides={path: -side for path, side in RAISED.items()}, short_mm=3.3)
    assert all(
        changes_of(space, point)[CLEAR] > 10.0 for point in lowered if CLEAR in changes_of(space, point)
    )


@pytest.fixture(scope="module")
def around_thick(tmp_path_factory):
    """A whole search around the thick design, made once."""
    return found_around(THICK, tmp_path_factory.mktemp("thick"))


def test_designs_that_differ_in_kind_are_picked(around_thick):
    space, found = around_thick
    wanted = picks(space, found.base, found.tried, "resolvable_steps")
    best = {kind: next(one.tried for one in wanted if one.kind == kind) for kind in KINDS[:3]}
    assert not [one for one in wanted if one.kind == "best accuracy"]  # a row has no location to tell
    assert len(changes_of(space, best["fewest changes"].parameters)) == 1
    assert {one.judged.verdict for one in best.values()} == {"CONTIGUOUS"}
    sound = [one for one in found.tried if is_sound(one.judged)]
    deepest = max(usable_of(one.judged) for one in sound)
    robust, deep = best["most robust"].judged, best["most depth"].judged
    assert usable_of(deep) > deepest - 0.51
    assert (
        margin_of(robust) == max(margin_of(one.judged) for one in sound) or margin_of(robust) >= AMPLE_MARGIN
    )
    assert usable_of(robust) >= 0.6 * usable_of(deep)


def test_a_lattice_covers_the_ranges_below_the_top():
    space = space_of(THICK)
    points = spread_points(space, 64)
    assert len(points) == 64
    assert {len({point[path] for point in points}) for path in (CLEAR,)} == {4}
    assert all(point[path] <= point[CLEAR] - 1.0 for point in points for path in HEIGHTS)
    ends = {field.path: (field.low, field.high) for field in space.fields}
    assert {min(p[CLEAR] for p in points), max(p[CLEAR] for p in points)} == set(ends[CLEAR])
    assert spread_points(space, 26) == []


def test_each_change_of_the_best_design_is_taken_back_by_itself(around_thick):
    space, found = around_thick
    points = refinements(space, found.tried, 0)
    known = [one.parameters for one in found.tried]
    assert points
    assert not [point for point in points if point in known]
    best = max(
        found.tried,
        key=lambda one: (one.judged.verdict == "CONTIGUOUS", min(one.judged.figures["margin"], 9)),
    )
    changed = changes_of(space, best.parameters)
    taken_back = [best.parameters | {path: start_of(space)[path]} for path in changed]
    assert all(point in points or point in known for point in taken_back)
    assert refinements(space, found.tried, 99) == []


@pytest.mark.slow
def test_a_search_goes_on_around_its_best_until_nothing_new_is_asked_for(tmp_path):
    space = space_of(THICK)
    url = f"sqlite:///{tmp_path / 'study.db'}"
    asked = []

    def refine(found, number):
        asked.append(number)
        return refinements(space, found.tried, number)

    whole = explore(space, judge, url, trials=8, refine=refine)
    assert asked == list(range(len(asked)))
    assert len(whole.tried) > 8
    again = explore(space, judge, url, trials=8, refine=refine)
    assert again.tried == whole.tried


def test_a_good_base_is_left_alone_but_for_a_clear_gain():
    space = space_of(PAIR)
    base = Judged(figures={"margin": 9.0, "usable_depth_mm": 4.0}, verdict="CONTIGUOUS")
    assert picks(space, base, [], "resolvable_steps") == []


def test_the_same_seed_finds_the_same_and_goes_on(tmp_path, around_thick):
    _, whole = around_thick
    space = space_of(THICK)
    url, first = f"sqlite:///{tmp_path / 'study.db'}", first_points(space, sides=RAISED, short_mm=3.3)
    explore(space, judge, url, trials=8, first=first)
    resumed = explore(space, judge, url, first=first)
    assert [one.parameters for one in resumed.tried] == [one.parameters for one in whole.tried]


def test_nothing_is_picked_where_nothing_mends_the_base(tmp_path):
    space, found = found_around(THICK, tmp_path, keep=[CLEAR, "receivers.height_mm"])
    assert picks(space, found.base, found.tried, "resolvable_steps") == []
