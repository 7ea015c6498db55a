"""What the studio draws and says: whole SVG, escaped words, a mold cut open, a top that ends at the pad's walls."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest

from optopad.design.errors import ModelScopeError
from optopad.design.fields.finding import error
from optopad.design.preset import FLAT_PRESETS, SHAPED_PRESETS, preset
from optopad.design.rules.check import check
from optopad.design.shape.cavity import CavityGeometry, cavity_of, workspace_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.driver.wiring_check import Problem
from optopad.sims.readings.readout import Readout
from optopad.sims.score.objective import PlaceCurves
from optopad.sims.score.result import JudgedPair
from optopad.sims.verdict.pad_map import PadMap, Place, grid_places_mm, map_grid_mm
from optopad.studio.drawings import QUANTITIES, curves_svg, map_svg, quantity, readings_svg
from optopad.studio.live import LiveView
from optopad.studio.pad_mesh import cut_open, pressed_top
from optopad.studio.sentences import held_html, pins_html, said_html, sensor_html, verdict_html
from optopad.studio.session import LivePress, Said, Version
from optopad.studio.workshop import LiveVerdict, Look, Progress
from tests.optopad.report.bounded_score import bounded_score
from tests.sims.made_up_scores import dead_score, made_up_depths, made_up_pair, out_of_scope_score

PAD, OBLONG = "piacenza2017-pad", "oblong-60x40"
DEAD, BOUNDED, REFUSED = dead_score(), bounded_score(), out_of_scope_score()
NASTY = """<b>"E1" & 'co'</b>"""
PRESS = LivePress(x_mm=11.0, y_mm=20.0, depth_mm=2.0)
TWO = LivePress(x_mm=8.0, y_mm=24.0, depth_mm=1.0, second_mm=(17.0, 24.0, 0.5))
DEEPEST_MM = 5.0


def drawn(svg: str) -> ElementTree.Element:
    """A drawing read as XML; none holds what is no number."""
    assert not re.search(r"\b(?:nan|inf)\b", svg)
    return ElementTree.fromstring(svg)


def texts(root: ElementTree.Element) -> list[str]:
    return [one.text or "" for one in root.iter() if one.tag.endswith("text")]


def titled(root: ElementTree.Element, tag: str) -> list[tuple[ElementTree.Element, str]]:
    """Elements of a tag that have a title, and the title."""
    found = [(one, one.find("title")) for one in root.iter(tag)]
    return [(one, title.text or "") for one, title in found if title is not None]


class Words(HTMLParser):
    """Text, tags and titles of HTML, all of which must be closed."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.text, self.tags, self.titles = "", set[str](), list[str]()
        self._open: list[str] = []
        self.feed(html)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self._open.append(tag)
        self.titles += [value or "" for name, value in attrs if name == "title"]

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def curves(*pairs: JudgedPair) -> PlaceCurves:
    readout = Readout(
        counts_per_flux=np.full(8, 1e5), full_scale_counts=1023.0, read_noise_counts=0.5, relative_noise=0.003
    )
    return PlaceCurves(place_mm=(11.0, 20.0), readout=readout, pairs=pairs, is_draft=True)


def version(design: SensorDesign, words: str = "") -> Version:
    return Version(design=design, findings=check(design), words=words)


@pytest.mark.parametrize("count", [1, 3, 8])
def test_curves_have_a_line_and_a_row_for_every_pair(count: int) -> None:
    pairs = [made_up_pair(f"E{k}-R{k}", onset_mm=2.0 + 0.2 * k) for k in range(count)]
    root = drawn(curves_svg(curves(*pairs), 2.0))
    lines = titled(root, "polyline")
    assert [title for _, title in lines] == [pair.name for pair in pairs]
    assert [text for text in texts(root) if "-R" in text] == [pair.name for pair in pairs]
    places = [point.split(",") for point in lines[0][0].attrib["points"].split()]
    assert len(places) == len(pairs[0].curves.depth_mm)
    assert (float(places[0][0]), float(places[-1][0])) == (40.0, 392.0)


def test_a_pair_s_row_shows_its_modes_and_deadbands_where_they_are() -> None:
    pair = made_up_pair(onset_mm=3.0)
    ((start, end),) = pair.score.deadbands_mm
    found = titled(drawn(curves_svg(curves(pair), 2.0)), "rect")
    kinds = [title.split(":")[0] for _, title in found]
    assert kinds[:3] == ["mode 1", "mode 2", "deadband"]
    dead, title = found[2]
    assert title == f"deadband: {start:.2f} to {end:.2f} mm"
    assert dead.attrib["fill"] == "url(#dead)"
    per_mm = (392.0 - 40.0) / DEEPEST_MM
    assert float(dead.attrib["x"]) == pytest.approx(40.0 + per_mm * start, abs=0.05)
    assert float(dead.attrib["width"]) == pytest.approx(per_mm * (end - start), abs=0.05)


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_map_has_a_cell_a_place_and_what_is_blind_is_hatched(name: str) -> None:
    score, cavity = BOUNDED, cavity_of(preset(PAD))
    found = quantity(name, score)
    assert found is not None
    values = found.values.copy()
    values[1, 2] = np.inf
    values[3, 0] = np.nan
    root = drawn(map_svg(cavity, replace(found, values=values), PRESS))
    cells = titled(root, "rect")
    assert len(cells) == len(found.x_mm) * len(found.y_mm) == found.values.size
    blind = [title for cell, title in cells if cell.attrib["fill"] == "url(#dead)"]
    x, y = found.x_mm, found.y_mm
    needed = [f"x {x[2]:g}, y {y[1]:g} mm: {found.absent}", f"x {x[0]:g}, y {y[3]:g} mm: {found.absent}"]
    assert blind == [
        f"x {x[j]:g}, y {y[i]:g} mm: {found.absent}" for i, j in np.argwhere(~np.isfinite(values))
    ]
    assert set(needed) <= set(blind)
    area = sum(float(cell.attrib["width"]) * float(cell.attrib["height"]) for cell, _ in cells)
    pitch = x[1] - x[0]
    scale = (400 - 52) / 32.0
    assert area == pytest.approx((scale * (5 * pitch)) ** 2, rel=0.01)
    assert f"{found.title} [{found.unit}]" in texts(root)


def test_a_map_is_the_pad_seen_from_above() -> None:
    cavity = cavity_of(preset(PAD))
    root = drawn(map_svg(cavity, None, replace(TWO, second_mm=None)))
    (tip,) = [one for one, _ in titled(root, "circle")]
    scale = (400 - 52) / 32.0
    assert float(tip.attrib["cx"]) == pytest.approx(26 + scale * 8.0, abs=0.06)
    assert float(tip.attrib["cy"]) == pytest.approx(26 + scale * (32.0 - 24.0), abs=0.06)
    assert float(tip.attrib["r"]) == pytest.approx(scale * 3.0, abs=0.06)
    two = drawn(map_svg(cavity, None, replace(TWO, second_mm=(14.0, 20.0, 0.5))))
    assert [title for _, title in titled(two, "circle")] == [
        "the first tip: x 8, y 24 mm",
        "the second tip: x 14, y 20 mm",
    ]


def test_the_readings_under_two_tips_are_titled_with_each_one_s_force() -> None:
    look = Look(
        digest="",
        press=TWO,
        points_mm=np.zeros((0, 3)),
        triangles=np.zeros((0, 3), int),
        force_n=5.0,
        area_mm2=0.0,
        tips_n=((3.0, 2.5), (2.0, 1.5)),
    )
    cavity = cavity_of(preset(PAD))
    changes = np.zeros((8, 8))
    changes[1, 2] = -40.0
    words = " ".join(held_html(look, changes, cavity).split())
    for expected in (
        "Under two touches</b>, 9.0 mm apart; the first at x 8.0, y 24.0 mm: 1.00 mm deep, 3.00 N (2.50 N alone)",
        "the second at x 17.0, y 24.0 mm: 0.50 mm deep, 2.00 N (1.50 N alone); 1 of 64 pairs change",
        "most E2-R3 by -40",
    ):
        assert expected in words


@pytest.mark.parametrize("name", SHAPED_PRESETS)
def test_a_map_has_a_cell_for_each_place_of_the_workspace_and_none_beside_it(name: str) -> None:
    design = preset(name)
    cavity = cavity_of(design)
    x_mm, y_mm = map_grid_mm(cavity, 5)
    places = [
        Place(x_mm=x, y_mm=y, depths=made_up_depths(usable_mm=2.0, margin=4.0), answering_pairs=1)
        for x, y in grid_places_mm(cavity.workspace, x_mm, y_mm).tolist()
    ]
    pad = PadMap(x_mm=tuple(x_mm), y_mm=tuple(y_mm), places=tuple(places))
    for shown in ("deadband", "usable depth", "margin"):
        root = drawn(map_svg(cavity, quantity(shown, replace(DEAD, pad_map=pad)), PRESS))
        cells = titled(root, "rect")
        assert len(cells) == len(places)
        assert all(cell.attrib["fill"] != "url(#dead)" for cell, _ in cells)
        assert len(list(root.iter("polygon"))) == 2  # the outline, and what cells are clipped to
    if cavity.workspace.arcs:
        assert len(places) < len(x_mm) * len(y_mm)


def test_readings_have_a_row_an_emitter_and_a_cell_a_pair() -> None:
    live = np.arange(6.0).reshape(2, 3) * 100
    root = drawn(readings_svg(["E1", "E2"], ["R1", "R2", "R3"], live, live + 10, ("E2", "E1-R3")))
    cells = titled(root, "rect")
    assert [title for _, title in cells] == [
        f"E{i + 1}-R{j + 1}: {live[i, j]:.0f} counts, simulated {live[i, j] + 10:.0f}"
        for i in range(2)
        for j in range(3)
    ]
    assert [title[:5] for cell, title in cells if cell.attrib["stroke"] != "none"] == ["E1-R3"]
    assert len({cell.attrib["y"] for cell, _ in cells}) == 2
    assert len({cell.attrib["x"] for cell, _ in cells}) == 3
    bare = drawn(readings_svg(["E1", "E2"], ["R1", "R2", "R3"], live, None))
    assert [title for _, title in titled(bare, "rect")][5] == "E2-R3: 500 counts"


def renamed(cavity: CavityGeometry, name: str) -> CavityGeometry:
    first, *rest = cavity.emitters
    return replace(cavity, emitters=(replace(first, name=name), *rest))


def drawings_of(name: str) -> Iterator[str]:
    """Every drawing, with a name in it."""
    yield curves_svg(curves(made_up_pair(name)), 1.0)
    yield map_svg(renamed(cavity_of(preset(PAD)), name), quantity("deadband", DEAD), PRESS, (name,))
    yield readings_svg([name], ["R1"], np.ones((1, 1)), np.ones((1, 1)), (name,))
    yield readings_svg(["E1"], [name], np.ones((1, 1)), None)


@pytest.mark.parametrize("number", range(4))
def test_a_name_in_a_drawing_is_text_whatever_it_is(number: int) -> None:
    root = drawn(list(drawings_of(NASTY))[number])
    assert NASTY in texts(root)
    assert "b" not in {one.tag for one in root.iter()}
    plain = drawn(list(drawings_of("E1"))[number])
    assert [one.tag for one in root.iter()] == [one.tag for one in plain.iter()]


def sentences_of(words: str) -> Iterator[str]:
    """Everything that is said, with words of somebody else's in it."""
    design = preset(PAD)
    now = version(design, words)
    score = replace(REFUSED, reason=words)
    judged = LiveVerdict(digest=design.digest, level="draft", score=score)
    yield verdict_html(now, None, words, None)
    yield verdict_html(now, judged, words, Progress(stage=words, share=0.5))
    fault = error("cavity.length_mm", words, value=words, limit=words, way_out=words)
    yield verdict_html(replace(now, findings=(fault,)), None, "", None)
    yield said_html(Said(text=words, is_bad=True), words="", is_saved=False)
    yield said_html(Said(text=""), words=words, is_saved=True)
    yield pins_html([now], now, {design.digest: judged})
    yield sensor_html(
        LiveView(status=words, problems=(Problem(kind=words, parts=("E1",), message=words, is_error=False),))
    )


@pytest.mark.parametrize("number", range(7))
def test_what_is_said_is_text_whatever_it_is(number: int) -> None:
    words = Words(list(sentences_of(NASTY))[number])
    assert NASTY in words.text or NASTY in words.titles
    plain = Words(list(sentences_of("E1"))[number])
    assert words.tags - {"b"} == plain.tags - {"b"}
    assert words.tags <= {"b", "div", "span", "table", "tr", "td", "th"}


def box(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """A closed box from the origin, normals outward."""
    points = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float) * size
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [corners for a, b, c, d in sides for corners in ((a, b, c), (a, c, d))]
    return points, np.array(triangles)


def area_and_volume(points: np.ndarray, triangles: np.ndarray) -> tuple[float, float]:
    """Area, and volume under an open cut: the flux of (x, 0, z) / 2, which a face across y does not carry."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a) / 2
    middle = (a + b + c) / 3
    return float(np.linalg.norm(normal, axis=1).sum()), float((normal * middle * [0.5, 0, 0.5]).sum())


@pytest.mark.parametrize("at", [0.0, 0.3, 1.0, 2.5, 3.999])
def test_a_box_cut_open_has_the_area_without_the_cut_face_and_the_volume_behind_it(at: float) -> None:
    wide, long, high = 2.0, 4.0, 3.0
    points, triangles = box((wide, long, high))
    assert area_and_volume(points, triangles) == (52.0, 24.0)
    left = long - at
    area, volume = area_and_volume(*cut_open(points, triangles, at))
    front = wide * high if at == 0.0 else 0.0  # the front lies in the cut and stays
    assert area == pytest.approx(2 * left * (wide + high) + wide * high + front)
    assert volume == pytest.approx(wide * high * left)


def projected_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, k], :2] for k in range(3))
    return ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / 2


@pytest.mark.parametrize("name", FLAT_PRESETS)
@pytest.mark.parametrize("corner", [(0.0, 0.0), (1.0, 1.0), (0.5, 0.5), (0.21, 0.83)])
@pytest.mark.parametrize("depth_mm", [0.0, 1.7])
def test_the_top_covers_the_pad_and_ends_at_its_walls(
    name: str, corner: tuple[float, float], depth_mm: float
) -> None:
    design = preset(name)
    space, size = workspace_of(design), (design.cavity.length_mm, design.cavity.width_mm)
    place = (
        space.x0_mm + corner[0] * (space.x1_mm - space.x0_mm),
        space.y0_mm + corner[1] * (space.y1_mm - space.y0_mm),
    )
    points, triangles, surface = pressed_top(design, place, depth_mm)
    assert (points[:, :2] >= 0.0).all()
    assert (points[:, :2] <= size).all()
    areas = projected_areas(points, triangles)
    assert areas.sum() == pytest.approx(size[0] * size[1], abs=1e-6 * size[0] * size[1])
    assert areas.min() > -1e-6
    assert triangles.max() == len(points) - 1
    clear_mm = design.cavity.clear_thickness_mm
    if depth_mm == 0.0:
        assert surface is None
        assert (points[:, 2] == clear_mm).all()
        return
    assert surface is not None
    apex = points[np.hypot(points[:, 0] - place[0], points[:, 1] - place[1]) < 1e-9]
    assert len(apex) > 0
    assert apex[:, 2] == pytest.approx(clear_mm - depth_mm, abs=1e-9)
    assert points[:, 2].min() == pytest.approx(clear_mm - depth_mm, abs=1e-9)


@pytest.mark.parametrize("name", [PAD, OBLONG])
def test_the_drawn_top_is_the_top_that_light_sees(name: str) -> None:
    design = preset(name)
    space = workspace_of(design)
    points, _, surface = pressed_top(design, (space.x0_mm + 1.0, space.y1_mm - 2.0), 2.5)
    assert surface is not None
    radius = np.hypot(points[:, 0] - surface.at_mm[0], points[:, 1] - surface.at_mm[1])
    points = points[
        np.abs(radius - surface.near.contact_radius_mm) > 1e-6
    ]  # the curve's end, where it has a step
    some = points[:: len(points) // 150]
    true = np.array([surface.height_mm(x[None], y[None])[0, 0] for x, y in some[:, :2]])
    assert some[:, 2] - design.cavity.clear_thickness_mm == pytest.approx(true, abs=0.01)


def test_a_press_that_the_contact_model_does_not_cover_is_refused() -> None:
    with pytest.raises(ModelScopeError, match="mm"):
        pressed_top(preset(PAD), (16.0, 16.0), 7.9)
