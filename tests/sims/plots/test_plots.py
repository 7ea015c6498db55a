"""Plots: what they show lies where the numbers say, axes carry units, files are the same each time."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from design.preset import preset
from design.press_protocol import load_protocol
from design.shape.cavity import cavity_of
from design.spec.properties import modulus
from sims.contact.load_protocol import LoadHistory, StandardLinearSolid, load_history
from sims.contact.pressure import ContactPressure
from sims.plots.contact import (
    plot_contact_radius,
    plot_force,
    plot_force_near,
    plot_load_over_time,
    plot_load_protocol,
    plot_pressure,
    plot_profile,
)
from sims.plots.maps import plot_deadband_map, plot_margin_map
from sims.plots.signal import plot_signal
from sims.plots.style import plain_style, plot_spans, svg_text
from sims.plots.tolerance import plot_gap_tolerance, plot_tolerance
from sims.press import Indentation
from sims.verdict.pad_map import PadMap
from tests.sims.made_up_scores import (
    FULL_SCALE,
    dead_score,
    made_up_band,
    made_up_force,
    made_up_map,
    made_up_pair,
)

PAD = preset("piacenza2017-pad")
CAVITY = cavity_of(PAD)
MODULUS = modulus(PAD)
SOLID = StandardLinearSolid(relaxed_share=0.3, time_constant_s=5.0)
TIP_MM = (np.array([0.0, 2.0, 3.0, 3.0]), np.array([0.0, 3.0 - 5.0**0.5, 3.0, 9.0]))


def areas(ax: Axes, gid: str) -> list[tuple[float, float]]:
    """Left and right end of the shaded areas with a group identifier."""
    found = [
        patch.get_patch_transform().transform_path(patch.get_path())
        for patch in ax.patches
        if patch.get_gid() == gid
    ]
    return [(float(path.vertices[:, 0].min()), float(path.vertices[:, 0].max())) for path in found]


def line(ax: Axes, label: str) -> np.ndarray:
    """(2, n) data of the curve with a label."""
    return np.array(next(one for one in ax.lines if one.get_label() == label).get_data())


def grid(ax: Axes) -> np.ndarray:
    """(ny, nx) values of the map."""
    mesh = next(one for one in ax.collections if isinstance(one, QuadMesh))
    return np.asarray(mesh.get_array()).reshape(mesh.get_coordinates().shape[0] - 1, -1)


def test_modes_and_deadbands_are_shaded_at_their_depths():
    pair = made_up_pair(onset_mm=3.0, last_mm=4.2)
    ax = plot_signal(pair)
    assert areas(ax, "mode1") == [pytest.approx(pair.score.modes.mode1_mm)]
    assert areas(ax, "mode2") == [pytest.approx(pair.score.modes.mode2_mm)]
    assert areas(ax, "deadband") == [pytest.approx(span) for span in pair.score.deadbands_mm]
    assert len(pair.score.deadbands_mm) == 1


def test_an_open_mode_2_is_shaded_to_the_deepest_press():
    pair = made_up_pair(onset_mm=4.0, last_mm=7.0)
    assert pair.score.modes.mode2_mm[1] is None
    assert areas(plot_signal(pair), "mode2") == [pytest.approx((pair.score.modes.mode2_mm[0], 5.0))]


def test_a_mode_2_that_never_begins_is_not_shaded():
    pair = made_up_pair(onset_mm=6.0, last_mm=7.0)
    assert areas(plot_signal(pair), "mode2") == []
    assert [note.get_text() for note in plot_signal(pair).texts] == ["mode 1 ends"]


def test_deadbands_are_hatched_so_that_they_do_not_rest_on_colour():
    hatched = [patch for patch in plot_signal(made_up_pair()).patches if patch.get_gid() == "deadband"]
    assert [patch.get_hatch() for patch in hatched] == ["////"]


def test_boundaries_are_marked_at_the_end_of_mode_1_and_the_onset_of_mode_2():
    pair = made_up_pair()
    marks = sorted(float(one.get_xdata()[0]) for one in plot_signal(pair).lines if len(one.get_xdata()) == 2)
    assert marks == pytest.approx([pair.score.modes.mode1_mm[1], pair.score.modes.mode2_mm[0]])


def test_curves_are_shares_of_the_untouched_total_and_add_up():
    pair = made_up_pair()
    ax = plot_signal(pair)
    depth, total = line(ax, "total")
    parts = sum(line(ax, name)[1] for name in ("direct", "top, mirrored", "other, scattered"))
    assert depth == pytest.approx(pair.curves.depth_mm)
    assert total[0] == 1.0
    assert parts == pytest.approx(total, abs=1e-12)


def test_full_scale_is_drawn_where_readings_clip():
    pair = made_up_pair(counts=1500.0)
    height = line(plot_signal(pair), "full scale of the converter")[1][0]
    assert height == pytest.approx(FULL_SCALE / 1500.0)
    assert "the converter" not in plot_signal(made_up_pair()).get_legend_handles_labels()[1]


def test_spans_give_every_pair_a_row_of_modes_and_deadbands():
    pairs = (made_up_pair("E1-R1"), made_up_pair("E1-R2", onset_mm=0.5))
    ax = plot_spans(pairs)
    assert [label.get_text() for label in ax.get_yticklabels()] == ["E1-R1", "E1-R2"]
    boxes = [path.get_extents() for bars in ax.collections for path in bars.get_paths()]
    first = [(box.x0, box.x1) for box in boxes if box.y1 < 0.5]
    score = pairs[0].score
    expected = [score.modes.mode1_mm, score.modes.mode2_mm, *score.deadbands_mm]
    assert sorted(first) == [pytest.approx(span) for span in sorted(expected)]


def test_the_map_shows_each_places_deadband_and_frames_the_worst():
    pad_map = made_up_map(CAVITY, dead_mm=1.9)
    ax = plot_deadband_map(pad_map, CAVITY)
    assert grid(ax) == pytest.approx(pad_map.deadband_grid_mm())
    (left, right), worst = areas(ax, "marked")[0], pad_map.worst
    assert (left + right) / 2 == pytest.approx(worst.x_mm)
    assert right - left == pytest.approx(5.0)


def test_the_map_draws_workspace_and_parts():
    ax = plot_deadband_map(made_up_map(CAVITY, dead_mm=1.9), CAVITY)
    assert areas(ax, "workspace") == [(6.0, 26.0)]
    places = sorted((float(one.get_xdata()[0]), float(one.get_ydata()[0])) for one in ax.lines)
    assert places == sorted(part.position_mm[:2] for part in CAVITY.parts)
    assert {part.name for part in CAVITY.parts} <= {text.get_text() for text in ax.texts}


def test_nothing_is_framed_on_a_map_without_a_deadband():
    assert areas(plot_deadband_map(made_up_map(CAVITY, dead_mm=0.0), CAVITY), "marked") == []


def test_the_margin_map_frames_the_weakest_place():
    pad_map = made_up_map(CAVITY, dead_mm=0.0)
    ax = plot_margin_map(pad_map, CAVITY)
    assert grid(ax)[0, 0] == 4.0
    left, right = areas(ax, "marked")[0]
    assert left < 6.0 < right


def test_a_map_of_one_place_is_drawn():
    full = made_up_map(CAVITY, dead_mm=1.0)
    one = PadMap(x_mm=full.x_mm[:1], y_mm=full.y_mm[:1], places=full.places[:1])
    assert grid(plot_deadband_map(one, CAVITY)).tolist() == [[pytest.approx(1.0)]]


def test_load_is_shaded_over_the_band_of_the_modulus():
    force = made_up_force()
    ax = plot_force(force, MODULUS, measured=[(0.6, 2.0, "stated")])
    low, high = ax.collections[0].get_paths()[0].get_extents().get_points()[:, 1]
    assert (low, high) == pytest.approx((0.0, force.force_n[-1] * MODULUS.high / MODULUS.value))
    assert line(ax, "stated").tolist() == [[0.6], [2.0]]


def test_a_measured_modulus_has_no_band():
    measured = replace_quantity(low=None, high=None)
    assert len(plot_force(made_up_force(band=(1.0, 1.0)), measured).collections) == 0


def replace_quantity(**changes: object) -> object:
    return MODULUS.model_copy(update=changes)


def test_the_near_view_reaches_twice_the_measured_depth():
    ax = plot_force_near(made_up_force(), MODULUS, (0.6, 2.0, "stated"))
    assert ax.get_xlim() == pytest.approx((0.0, 1.2))
    assert ax.get_ylim()[1] > 2.0


def test_a_profile_is_drawn_to_one_scale_with_the_tip_in_the_dimple():
    ax = plot_profile(made_up_press(), TIP_MM)
    assert ax.get_aspect() == 1.0
    surface, tip = line(ax, "surface at 2 mm, 10 N"), np.array(ax.lines[0].get_data())
    assert surface[1].min() == tip[1].min() == -2.0
    assert surface[0] == pytest.approx(-surface[0][::-1])
    assert line(ax, "edge of the contact, at 2.50 mm")[0].tolist() == [-2.5, 2.5]


def test_an_untouched_pad_has_no_contact_edge():
    press = replace(made_up_press(), depth_mm=0.0, contact_radius_mm=0.0, force_n=0.0)
    labels = plot_profile(press, TIP_MM).get_legend_handles_labels()[1]
    assert labels == ["surface at 0 mm, 0 N", "undisturbed surface"]


def test_pressure_is_mirrored_and_says_when_it_is_not_resolved():
    ax = plot_pressure(made_up_pressure())
    assert line(ax, "depth 2 mm")[0].tolist() == [-2.5, -1.0, 0.0, 0.0, 1.0, 2.5]
    assert ax.get_title() == ""
    assert "not resolved" in plot_pressure(replace(made_up_pressure(), is_resolved=False)).get_title()


def test_a_load_protocol_without_relaxation_is_one_curve_and_with_it_a_loop():
    elastic, relaxing = made_up_history(None), made_up_history(SOLID)
    assert plot_load_protocol(elastic).get_legend_handles_labels()[1] == [
        "pressing and retracting: the same, elastic",
        "end of a pause",
    ]
    ax = plot_load_protocol(relaxing)
    inward, outward = line(ax, "pressing"), line(ax, "retracting")
    at_mm = 2.5
    assert np.interp(at_mm, *inward) > 1.05 * np.interp(at_mm, *outward[:, ::-1])
    assert line(ax, "end of a pause")[0].tolist() == [1, 2, 3, 4, 5, 4, 3, 2, 1, 0]


def test_load_over_time_shows_the_elastic_press_where_the_load_relaxes():
    labels = plot_load_over_time(made_up_history(SOLID)).get_legend_handles_labels()[1]
    assert "elastic press (fully relaxed)" in labels
    assert len(plot_load_over_time(made_up_history(None)).get_legend_handles_labels()[1]) == 2


def made_up_press() -> Indentation:
    angle = np.linspace(0.0, np.arcsin(2.5 / 3.0), 20)
    radius = np.concatenate([3.0 * np.sin(angle), [4.0, 8.0, 16.0]])
    height = np.concatenate([1.0 - 3.0 * np.cos(angle), [-0.3, 0.05, 0.0]])
    return Indentation(
        depth_mm=2.0,
        tip_radius_mm=3.0,
        radius_mm=radius,
        height_mm=height,
        contact_radius_mm=2.5,
        force_n=10.0,
    )


def made_up_pressure() -> ContactPressure:
    return ContactPressure(
        depth_mm=2.0,
        radius_mm=np.array([0.0, 1.0, 2.5]),
        height_mm=np.array([-2.0, -1.8, -0.7]),
        pressure_mpa=np.array([0.8, 0.7, 0.0]),
        is_resolved=True,
    )


def made_up_history(solid: StandardLinearSolid | None) -> LoadHistory:
    return load_history(load_protocol("piacenza2017"), lambda depth_mm: 3.3 * depth_mm**1.5, solid)


def test_tolerance_marks_both_ends_of_every_value():
    band = made_up_band("E1-R1", 1.2)
    ax = plot_tolerance(band)
    marks = {
        marker: [float(one.get_xdata()[0]) for one in ax.lines if one.get_marker() == marker]
        for marker in "<>"
    }
    assert marks["<"] == [row.deadband_mm[0] for row in band.rows]
    assert marks[">"] == [row.deadband_mm[1] for row in band.rows]
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert [label.startswith("* ") for label in labels] == [row.flips for row in band.rows]


def test_an_end_without_mode_2_stands_as_text_on_the_gap_plot():
    band = made_up_band("E1-R1", 1.2)
    texts = [note.get_text() for note in plot_gap_tolerance(band).texts]
    assert texts == ["low end: mode 2 not reached"]
    both = replace(band, rows=(replace(band.rows[1], gap_mm=(None, None)),), gap_mm=None)
    assert [note.get_text() for note in plot_gap_tolerance(both).texts] == ["both ends: mode 2 not reached"]


def every_plot(ax: Axes | None = None) -> dict[str, Axes]:
    score = dead_score()
    assert score.pad_map is not None
    assert score.force is not None
    assert score.tolerance is not None
    return {
        "signal": plot_signal(score.pairs[0], ax),
        "spans": plot_spans(score.pairs[:3], ax),
        "deadband": plot_deadband_map(score.pad_map, CAVITY, ax),
        "margin": plot_margin_map(score.pad_map, CAVITY, ax),
        "force": plot_force(score.force, MODULUS, ax),
        "radius": plot_contact_radius(score.force, ax),
        "profile": plot_profile(made_up_press(), TIP_MM, ax),
        "pressure": plot_pressure(made_up_pressure(), ax),
        "protocol": plot_load_protocol(made_up_history(SOLID), ax),
        "protocol-time": plot_load_over_time(made_up_history(SOLID), ax),
        "tolerance": plot_tolerance(score.tolerance, ax),
        "gap": plot_gap_tolerance(score.tolerance, ax),
    }


def test_axes_are_labelled_with_their_units():
    units = {
        "signal": ("[mm]", "[-]"),
        "spans": ("[mm]", ""),
        "deadband": ("[mm]", "[mm]"),
        "margin": ("[mm]", "[mm]"),
        "force": ("[mm]", "[N]"),
        "radius": ("[mm]", "[mm]"),
        "profile": ("[mm]", "[mm]"),
        "pressure": ("[mm]", "[MPa]"),
        "protocol": ("[mm]", "[N]"),
        "protocol-time": ("[s]", "[N]"),
        "tolerance": ("[mm]", ""),
        "gap": ("[mm]", ""),
    }
    for name, ax in every_plot().items():
        assert ax.get_xlabel().endswith(units[name][0]), name
        assert ax.get_ylabel().endswith(units[name][1]), name


def test_the_colour_bars_carry_units():
    figure = every_plot()["deadband"].figure
    assert [bar.get_ylabel() for bar in figure.axes[1:]] == ["deadband at this location [mm]"]
    figure = every_plot()["margin"].figure
    assert [bar.get_ylabel() for bar in figure.axes[1:]] == [
        "margin: least change over 0.3 mm of depth [sigma]"
    ]


def test_plots_draw_on_the_axes_given():
    ax = Figure().add_subplot()
    assert all(drawn is ax for drawn in every_plot(ax).values())


def test_drawing_leaves_the_callers_settings_alone():
    with matplotlib.rc_context({"font.size": 33.0, "svg.fonttype": "path"}):
        before = dict(matplotlib.rcParams)
        with plain_style():
            assert matplotlib.rcParams["font.size"] == 9.0
            svg_text(plot_signal(made_up_pair()).figure, "signal")
        assert dict(matplotlib.rcParams) == before


def test_svg_is_the_same_each_time_and_holds_text_but_no_date():
    texts = []
    for _ in range(2):
        with plain_style():
            texts.append(svg_text(plot_signal(made_up_pair()).figure, "signal"))
    assert texts[0] == texts[1]
    root = ElementTree.fromstring(texts[0])
    names = {element.tag.rpartition("}")[2] for element in root.iter()}
    assert "metadata" not in names
    assert "depth of the press [mm]" in {element.text for element in root.iter()}


@pytest.mark.slow
def test_no_display_and_no_global_figures_are_needed():
    modules = "sims.plots.maps, sims.plots.signal, sims.plots.contact, sims.plots.tolerance"
    program = f"import sys, {modules}; print('matplotlib.pyplot' in sys.modules)"
    root = Path(__file__).parents[3]
    found = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "False"
