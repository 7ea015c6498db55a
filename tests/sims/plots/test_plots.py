"""Plots: what they show lies where the numbers say, axes carry units, files are the same each time."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh

from optopad.design.preset import preset
from optopad.design.press_protocol import load_protocol
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec.properties import modulus
from optopad.sims.contact.load_protocol import LoadHistory, StandardLinearSolid, load_history
from optopad.sims.contact.pressure import ContactPressure
from optopad.sims.plots.contact import (
    plot_contact_radius,
    plot_force,
    plot_load_over_time,
    plot_load_protocol,
    plot_pressure,
    plot_profile,
)
from optopad.sims.plots.maps import plot_deadband_map, plot_margin_map
from optopad.sims.plots.signal import plot_signal
from optopad.sims.plots.style import plain_style, plot_spans, svg_text
from optopad.sims.plots.tolerance import plot_gap_tolerance, plot_tolerance
from optopad.sims.press import Indentation
from tests.sims.made_up_scores import (
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


def test_the_margin_map_frames_the_weakest_place():
    pad_map = made_up_map(CAVITY, dead_mm=0.0)
    ax = plot_margin_map(pad_map, CAVITY)
    assert grid(ax)[0, 0] == 4.0
    left, right = areas(ax, "marked")[0]
    assert left < 6.0 < right


def test_load_is_shaded_over_the_band_of_the_modulus():
    force = made_up_force()
    ax = plot_force(force, MODULUS, measured=[(0.6, 2.0, "stated")])
    low, high = ax.collections[0].get_paths()[0].get_extents().get_points()[:, 1]
    assert (low, high) == pytest.approx((0.0, force.force_n[-1] * MODULUS.high / MODULUS.value))
    assert line(ax, "stated").tolist() == [[0.6], [2.0]]


def test_a_profile_is_drawn_to_one_scale_with_the_tip_in_the_dimple():
    ax = plot_profile(made_up_press(), TIP_MM)
    assert ax.get_aspect() == 1.0
    surface, tip = line(ax, "surface at 2 mm, 10 N"), np.array(ax.lines[0].get_data())
    assert surface[1].min() == tip[1].min() == -2.0
    assert surface[0] == pytest.approx(-surface[0][::-1])
    assert line(ax, "edge of the contact, at 2.50 mm")[0].tolist() == [-2.5, 2.5]


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
    program = (
        "import sys; from optopad.sims.plots import contact, maps, signal, tolerance; "
        "print('matplotlib.pyplot' in sys.modules)"
    )
    root = Path(__file__).parents[3]
    found = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "False"


def test_a_measured_modulus_has_no_band():
    measured = replace_quantity(low=None, high=None)
    assert len(plot_force(made_up_force(band=(1.0, 1.0)), measured).collections) == 0


def replace_quantity(**changes: object) -> object:
    return MODULUS.model_copy(update=changes)
