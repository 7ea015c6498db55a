"""Presses of objects: contact against finite strains and solved balls, light against the engine of balls.

    python -m tests.validation.held.object_table            all tables of docs/validation/objects.md
    python -m tests.validation.held.object_table contact    one of them: contact, balls, light, crowns, symmetry

`contact` takes half a minute and reads `truth.csv`, with the presses that it has; `light` takes a minute with stored
light, and some minutes without.

* Long objects are pressed into a pad of 32 x 128 mm, on a grid of 0.16 mm as the paper's pad has. They lie along it,
  and their ends curve upward. Force, contact and top are those of the middle section. Between walls 160 mm apart, the
  product's wide layer is solved in the section alone.
* Short objects are pressed into the middle of the paper's pad, as `optopad press` does it.
* A press that the product refuses is computed without its rule for sharp edges.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import process_time
from unittest.mock import patch

import numpy as np
from scipy.interpolate import LinearNDInterpolator, RegularGridInterpolator
from scipy.spatial.distance import cdist

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.held_object import held_of
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.design.shape.cavity import direct_path_pairs
from optopad.sims.contact.held import press as model
from optopad.sims.contact.held.layer import wide_compliance
from optopad.sims.contact.held.solve import contact_pressure
from optopad.sims.contact.pad_surface import PadSurface, pad_surface
from optopad.sims.contact.scope import Contact, contact_of
from optopad.sims.held import AskedPress, held_light, pressed
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.tracing import trace
from optopad.sims.press import GridTop
from tests.validation.contact.contact_table import markdown_table, write_tables
from tests.validation.contact.crown.crown_oracle import Crown
from tests.validation.contact.crown.offset_oracle import PADS, StoredState, offset_state
from tests.validation.contact.crown.offset_table import error_of, errors, surface
from tests.validation.held.plane_cases import LAYER_MM, PLANE_CASES, PlaneCase
from tests.validation.held.truth_file import BESIDE_MM, FAR_MM, Row, read_truth

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "objects.md"
PAD = "piacenza2017-pad"
MIDDLE = (16.0, 16.0)
LENGTH_MM, STRAIGHT_MM, END_MM = 128.0, 104.0, 4.0
"""Length of the pad under long objects, of their straight part, and the radius of curvature of their ends."""
SHORT = {
    "ball, radius 3": "sphere,radius=3",
    "lying cylinder, radius 3, length 8 along x": "cylinder,radius=3,length=8,edge=0.5",
    "box edge, length 10 along x": "box,length=10,width=10,height=10,edge=0.5,pose=edge",
}
FITTED = ("long", "ball")
"""Kinds of objects that the force's factor for finite strains was fitted to."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """The modelled top along an axis, and the whole press.

    Attributes
    ----------
    force : over Young's modulus; of long objects, per length
    edge_mm : half width of the contact along the axis
    at_mm, height_mm : (n,) distance from the middle, height of the top
    area_mm2 : of the contact; 0 for long objects
    """

    force: float
    edge_mm: float
    at_mm: FloatArray
    height_mm: FloatArray
    area_mm2: float = 0.0

    @classmethod
    def of(cls, at_mm: FloatArray, height_mm: FloatArray, level: FloatArray, **rest: float) -> Line:
        """With the edge where the level passes 0."""
        outside = int(np.flatnonzero((at_mm > 0.0) & (level < 0.0))[0])
        pair = slice(outside - 1, outside + 1)
        edge = float(np.interp(0.0, level[pair][::-1], at_mm[pair][::-1]))
        return cls(edge_mm=edge, at_mm=at_mm, height_mm=height_mm, **rest)


def section_mm(case: PlaneCase, x: FloatArray) -> FloatArray:
    """(n,) height of a long object's section above its lowest point; infinite beside it."""
    edge = case.half_width_mm if case.edge_mm is None else case.edge_mm
    beyond = np.maximum(np.abs(x) - (case.half_width_mm - edge), 0.0)
    return np.where(beyond < edge, edge - np.sqrt(np.maximum(edge**2 - beyond**2, 0.0)), np.inf)


@cache
def long_pad() -> Contact:
    """A pad as wide as the paper's, four times as long."""
    return contact_of(preset(PAD).with_(**{"cavity.width_mm": LENGTH_MM}))


def long_press(case: PlaneCase, depth_mm: float) -> list[Line]:
    """The middle section under a long object in the long pad."""
    at = (0.5 * case.width_mm, 0.5 * LENGTH_MM)
    with patch.object(model, "MOST_STEPS", round(LENGTH_MM / model.FINE.step_mm)):
        x, y = model.grid_of(long_pad(), at)
        ends = np.maximum(np.abs(y) - 0.5 * STRAIGHT_MM, 0.0) ** 2 / (2.0 * END_MM)
        found = model.held_press(long_pad(), at, section_mm(case, x)[:, None] + ends, depth_mm=depth_mm)
    middle = len(y) // 2
    force = float(found.pressure_mpa[:, middle].sum() * (x[1] - x[0]) / long_pad().draft.modulus.value)
    return [Line.of(x, found.top.height_mm[:, middle], found.top.level[:, middle], force=force)]


def wide_press(case: PlaneCase, depth_mm: float) -> list[Line]:
    """The section under a long object on the wide layer, repeated at the distance of the walls."""
    if case.edge_mm is not None and depth_mm > model.SHARP_SHARE * LAYER_MM:
        raise ModelScopeError("the contact ends at a steep side")
    count = round(case.width_mm / model.FINE.step_mm)
    step = case.width_mm / count
    x = step * np.arange(-(count // 2), count - count // 2, dtype=np.float64)
    compliance = wide_compliance(np.abs(2.0 * np.pi * np.fft.fftfreq(count, step)), LAYER_MM)

    def moved(load: FloatArray) -> FloatArray:
        return np.asarray(np.fft.ifft(np.fft.fft(load) * compliance).real)

    overlap = section_mm(case, x) - depth_mm
    load, gap = contact_pressure(moved, overlap, model.FINE.settled * depth_mm, np.maximum(-overlap, 0.0))
    tall, apart = (np.repeat(one[:, None], 9, axis=1) for one in (load, np.where(load > 0.0, 0.0, gap)))
    level = model.edge_level(tall, apart, step)[:, 4]
    factor = 1.0 - model.STIFFER * depth_mm / LAYER_MM
    height = np.where(load > 0.0, overlap, -moved(load))
    return [Line.of(x, height, level, force=float(load.sum() * step / 3.0 / factor))]


def short_press(text: str, depth_mm: float) -> list[Line]:
    """The top along x and along y under an object in the middle of the paper's pad."""
    draft = Draft.of(preset(PAD))
    found = pressed(draft, AskedPress(held=(held_of(text),), at_mm=MIDDLE, depth_mm=depth_mm))
    top, force = found.top, found.force_n / draft.modulus.value
    i, j = (int(np.abs(one).argmin()) for one in (top.x_mm, top.y_mm))
    return [
        Line.of(top.x_mm, top.height_mm[:, j], top.level[:, j], force=force, area_mm2=found.area_mm2),
        Line.of(top.y_mm, top.height_mm[i], top.level[i], force=force, area_mm2=found.area_mm2),
    ]


def of_case(name: str) -> Callable[[float], list[Line]]:
    """Depth -> the modelled press of a stored case."""
    if name in SHORT:
        return lambda depth: short_press(SHORT[name], depth)
    case = PLANE_CASES[name]
    kind = long_press if case.width_mm == 2.0 * MIDDLE[0] else wide_press
    return lambda depth: kind(case, depth)


def solved(name: str, depth_mm: float) -> tuple[list[Line], bool]:
    """The modelled press of a stored case, and whether the product refuses it."""
    try:
        return of_case(name)(depth_mm), False
    except ModelScopeError:
        with patch.object(model, "SHARP_SHARE", 1.0):
            return of_case(name)(depth_mm), True


def contact_row(name: str, depth_mm: float, rows: dict[str, Row]) -> list[str]:
    """One press against the stored one; heights at the same distances from the middle."""
    lines, is_refused = solved(name, depth_mm)
    force = next(row for key, row in rows.items() if key.startswith("force"))
    edges, tops, meshes = [], list[FloatArray](), list[float]()
    for axis, line in zip("xy", lines, strict=False):
        half = rows["contact half width [mm]" if len(lines) == 1 else f"contact half width along {axis} [mm]"]
        edges.append(f"{100.0 * (line.edge_mm / half.value - 1.0):+.1f}")
        places = {f"edge + {beside:g}": half.value + beside for beside in BESIDE_MM}
        wanted = {f"height at {axis} = {key} mm [mm]": at for key, at in places.items()}
        wanted |= {f"height at {axis} = {far:g} mm [mm]": far for far in FAR_MM}
        heights = np.interp(list(wanted.values()), line.at_mm, line.height_mm)
        tops.append(1e3 * (heights - [rows[key].value for key in wanted]))
        meshes += [1e3 * abs(rows[key].mesh_error) for key in wanted]
    largest = float(np.abs(tops).max())
    if (area := rows.get("contact area from above [mm2]")) is not None:
        edges.append(f"{100.0 * (lines[0].area_mm2 / area.value - 1.0):+.1f}")
    return [
        name,
        "yes" if name.startswith(FITTED) else "no",
        f"{depth_mm:g}",
        "refused" if is_refused else "yes",
        f"{100.0 * (lines[0].force / force.value - 1.0):+.1f}",
        ", ".join(edges),
        f"{largest:.0f}",
        f"{0.1 * largest / depth_mm:.1f}",
        "; ".join(", ".join(f"{one:+.0f}" for one in top) for top in tops),
        f"{100.0 * abs(force.mesh_error / force.value):.2f}",
        f"{max(meshes):.1f}",
    ]


def contact() -> str:
    """A row for each stored press."""
    head = ["object", "fitted", "depth mm", "covered", "force %", "half width; x, y, area %"]
    head += ["top: largest µm", "% of the depth", "at the edge + 0.5, 1, 2, 4 mm, at 10, 13 mm; µm"]
    head += ["the solution's meshes: force %", "top µm"]
    body = []
    for name, rows in read_truth().items():
        for depth in dict.fromkeys(row.depth_mm for row in rows):
            kept = {row.quantity: row for row in rows if row.depth_mm == depth}
            body.append(contact_row(name, depth, kept))
    return markdown_table(head, body)


def balls() -> str:
    """The design's ball as an object against the solved presses."""
    head = ["press", "depth mm", "force %", "contact radius %", "top: rms, largest µm", "% of the depth"]
    body = []
    design, radius = preset(PAD), preset(PAD).indenter.tip_radius_mm
    for name, at in (("middle", MIDDLE), ("corner of the workspace", (6.0, 6.0))):
        for depth in (0.25, 0.5, 1.0, 1.5, 2.0):
            found = ball(PAD, at, depth, radius)
            solved = pad_surface(design, depth, at)
            edge = solved.near.contact_radius_mm
            top = found.top
            wanted = solved.height_mm(top.x_mm + at[0], top.y_mm + at[1])
            outside = np.hypot(top.x_mm[:, None], top.y_mm) > edge
            off = 1e3 * (top.height_mm - wanted)[outside]
            largest = float(np.abs(off).max())
            body.append(
                [
                    f"{name} ({at[0]:g}, {at[1]:g})",
                    f"{depth:g}",
                    f"{100.0 * (found.force_n / solved.near.force_n - 1.0):+.1f}",
                    f"{100.0 * (np.sqrt(found.area_mm2 / np.pi) / edge - 1.0):+.1f}",
                    f"{np.sqrt(np.mean(off**2)):.1f}, {largest:.0f}",
                    f"{0.1 * largest / depth:.1f}",
                ]
            )
    return markdown_table(head, body)


def ball(name: str, at_mm: tuple[float, float], depth_mm: float, radius_mm: float) -> model.HeldPress:
    """A ball as an object."""
    held = (held_of(f"sphere,radius={radius_mm:g}"),)
    return pressed(Draft.of(preset(name)), AskedPress(held=held, at_mm=at_mm, depth_mm=depth_mm))


LIGHT = (PAD, "gripper-teensy", "gripper-stadium", "fingertip-dome")
ACCURACY = "score"
SHARES = (0.15, 1.0 / 3.0, 0.5, 0.8)
"""Depths over the tip's radius."""
MOVED_MM = ((0.0, 0.0), (-2.0, -1.5), (1.0, -2.0), (-1.0, 1.0))
"""Locations of these presses, from the middle."""


def grid_top(surface: PadSurface, at_mm: tuple[float, float], sides_mm: tuple[float, float]) -> GridTop:
    """A solved press as a grid, as fine as that of an object's press."""
    step = max(sides_mm) / min(int(np.ceil(max(sides_mm) / model.FINE.step_mm)), model.MOST_STEPS)
    x, y = (step * np.arange(-1.0, np.ceil(side / step) + 2.0) for side in sides_mm)
    away = np.hypot(x[:, None] - at_mm[0], y - at_mm[1])
    return GridTop(
        at_mm=at_mm,
        x_mm=x - at_mm[0],
        y_mm=y - at_mm[1],
        height_mm=surface.height_mm(x, y),
        level=surface.near.contact_radius_mm - away,
    )


def size(values: FloatArray) -> str:
    """Root mean square and largest [%]."""
    return f"{100.0 * np.sqrt(np.mean(values**2)):.2f}, {100.0 * np.abs(values).max():.2f}"


def rms(values: FloatArray) -> str:
    """Root mean square [%]."""
    return size(values).split(",")[0]


def light_rows(name: str) -> Iterator[list[str]]:
    """A row a press: changes over the light without contact, of pairs with parts in different walls."""
    design, pad = preset(name), Pad.of(preset(name))
    draft, scene, radius = Draft.of(design), scene_of(design), design.indenter.tip_radius_mm
    middle, pairs = draft.plan.outline.centre_mm, direct_path_pairs(draft.cavity)
    places = [(middle[0] + dx, middle[1] + dy) for dx, dy in MOVED_MM]
    depths = [share * radius for share in SHARES]
    states = [(*place, depth) for place, depth in zip(places, depths, strict=True)]
    engine = trace(pad, np.array([*states, (0.0, 0.0, 0.0)]), accuracy="fine")
    before = engine.flux[-1]
    for k, (place, depth) in enumerate(zip(places, depths, strict=True)):
        surface = pad_surface(design, depth, place)
        tops = [None, grid_top(surface, place, (scene.length_mm, scene.width_mm))]
        with suppress(ModelScopeError):
            tops.append(ball(name, place, depth, radius).top)
        wanted = engine.flux[k] / before - 1.0
        trace_scene(scene, np.zeros((2, 2)), tops[:2], accuracy=ACCURACY)
        start = process_time()
        light = trace_scene(scene, np.zeros((1, 2)), tops[1:2], accuracy=ACCURACY)
        took = process_time() - start
        light = trace_scene(scene, np.zeros((len(tops), 2)), tops, accuracy=ACCURACY)
        flux = light.flux.sum(axis=0)
        off = (flux[1:] / flux[0] - 1.0 - wanted)[:, pairs]
        yield [
            name,
            f"{depth:.3g}",
            rms(wanted[pairs]),
            size(off[0]),
            rms((light.change_error[1] / flux[0])[pairs]),
            rms((engine.standard_error[k] / before)[pairs]),
            f"{took:.2f}",
            size(off[1]) if len(off) > 1 else "refused",
        ]


def light() -> str:
    """Balls by the method for grids, against the engine of balls."""
    head = ["preset", "depth mm", "change rms %", "solved top as a grid: rms, largest %", "stated error %"]
    head += ["the engine's own stated error %", "core-s a state", "top of the object's press: rms, largest %"]
    return markdown_table(head, [row for name in LIGHT for row in light_rows(name)])


DOME, BESIDE_APEX = "fingertip-dome", "fingertip"
"""A preset, and the stored presses 5 mm from its apex."""
PLACE = (16.0, 11.0)
SET_IN_MM = 0.3
"""Width outside the contact over which the stored top replaces the modelled one."""


def solved_top(press: model.HeldPress, points_mm: FloatArray, risen_mm: FloatArray) -> GridTop:
    """A modelled top with the heights (nx, ny) that half a pad was solved to have, at points (nx, ny, 3), in its place.

    Beyond the solved points, at the rim, the top is held.
    """
    top, edge_mm = press.top, float(np.sqrt(press.area_mm2 / np.pi))
    nodes = np.meshgrid(top.x_mm, np.abs(top.y_mm), indexing="ij")
    found = LinearNDInterpolator(points_mm[..., :2].reshape(-1, 2), risen_mm.ravel(), 0.0)(*nodes)
    away = np.clip((np.hypot(*nodes) - edge_mm) / SET_IN_MM, 0.0, 1.0)
    share = away * away * (3.0 - 2.0 * away)
    return replace(top, height_mm=top.height_mm + share * (found - top.height_mm))


def crown_rows(depth_mm: float) -> Iterator[list[str]]:
    """A ball away from the apex of a dome: the models of objects and of balls, and the solution's coarser mesh."""
    pad, draft, scene = PADS[BESIDE_APEX], Draft.of(preset(DOME)), scene_of(preset(DOME))
    press, states = ball(DOME, PLACE, depth_mm, pad.tip_mm), list[StoredState]()
    tops: list[GridTop | None] = [None, press.top]
    for half in (False, True):
        states.append(offset_state(BESIDE_APEX, depth_mm, half=half))
        solution = surface(pad, states[-1])[0]
        drop = pad.tip_mm * Crown(pad.chart.curvature).drop(solution.radius_mm / pad.tip_mm)
        tops.append(solved_top(press, solution.points_mm, solution.points_mm[..., 2] + drop))
        if not half:
            heights = press.top.x_mm, press.top.y_mm, press.top.height_mm
            found = RegularGridInterpolator(heights[:2], heights[2], bounds_error=False, fill_value=0.0)
            below = found(solution.points_mm[..., :2]) - drop - solution.points_mm[..., 2]
            off_um, oracle = 1e3 * below * solution.normals[..., 2], solution
    ratio = press.force_n / draft.modulus.value / float(states[0].force_n[2])
    of_balls = errors(BESIDE_APEX, depth_mm)
    light = trace_scene(scene, np.zeros((len(tops), 2)), tops, accuracy="fine")
    at = np.array([(*PLACE, depth_mm), (0.0, 0.0, 0.0)])
    engine = trace(Pad.of(preset(DOME)), at, accuracy="fine")
    change = light.flux.sum(axis=0)[1:] / light.flux.sum(axis=0)[0] - 1.0
    stated = light.change_error[1:] / light.flux.sum(axis=0)[0]
    pairs = direct_path_pairs(draft.cavity)
    edge_mm = float(np.sqrt(press.area_mm2 / np.pi))
    for kind, error, changed, own in (
        ("objects", error_of(pad, oracle, off_um, ratio, edge_mm), change[0], stated[0]),
        (
            "balls",
            of_balls["along the normal"],
            engine.flux[0] / engine.flux[1] - 1.0,
            engine.standard_error[0] / engine.flux[1],
        ),
        ("the solution's coarser mesh", of_balls["mesh"], change[2], stated[2]),
    ):
        yield [
            f"{depth_mm:g}",
            rms(change[1][pairs]),
            kind,
            f"{100.0 * (error.force_ratio - 1.0):+.1f}",
            f"{error.pad_um[0]:.0f}, {error.pad_um[1]:.0f}",
            size((changed - change[1])[pairs]),
            rms(own[pairs]),
        ]


def crowns() -> str:
    """Rows at the depths that are solved and that the model of objects covers."""
    head = ["depth mm", "change rms %", "model", "force %", "top to the wall: rms, largest µm"]
    head += ["light: rms, largest %", "stated error %"]
    return markdown_table(head, [row for depth in (0.5, 1.0) for row in crown_rows(depth)])


def symmetry() -> str:
    """A turned cylinder, and two balls far apart."""
    head = ["presses", "change: rms, largest %", "difference: rms, largest %", "stated error %", "forces %"]
    body = [turned()]
    for name, one, other, depth in (
        (PAD, (10.0, 10.0), (22.0, 22.0), 0.3),
        (PAD, (10.0, 16.0), (22.0, 16.0), 0.3),
        ("oblong-60x40", (12.0, 12.0), (48.0, 28.0), 1.0),
    ):
        body.append(two_balls(name, one, other, depth))
    return markdown_table(head, body)


def turned() -> list[str]:
    """A cylinder against the one that is turned by 90 degrees about the middle of the pad."""
    draft = Draft.of(preset(PAD))
    asked = [
        AskedPress(held=(held_of(f"cylinder,radius=4,yaw={yaw}"),), at_mm=at, depth_mm=1.0)
        for yaw, at in ((20, (14.0, 17.0)), (110, (15.0, 14.0)))
    ]
    presses = [pressed(draft, one) for one in asked]
    found = held_light(draft, presses, accuracy=ACCURACY)
    image = []
    for parts in (draft.cavity.emitters, draft.cavity.receivers):
        at = np.array([part.position_mm[:2] for part in parts]) - MIDDLE
        image.append(cdist(np.stack([-at[:, 1], at[:, 0]], axis=1), at).argmin(axis=1))
    change, error = (one / found.untouched for one in (found.flux - found.untouched, found.error))
    difference = change[1][np.ix_(*image)] - change[0]
    stated = np.hypot(error[0], error[1][np.ix_(*image)])
    forces = f"{100.0 * (presses[1].force_n / presses[0].force_n - 1.0):+.2f}"
    words = f"{PAD}: cylinder of radius 4 mm, 1 mm deep, and turned by 90° about the middle"
    return [words, size(change[0]), size(difference), rms(stated), forces]


def two_balls(name: str, one: tuple[float, float], other: tuple[float, float], depth_mm: float) -> list[str]:
    """Two balls at once against the sum of their changes."""
    draft = Draft.of(preset(name))
    first, second = (held_of(f"sphere,radius=3,x={at[0]:g},y={at[1]:g}") for at in (one, other))
    asked = [((first,), one), ((second,), other), ((first, second), one)]
    presses = [pressed(draft, AskedPress(held=held, at_mm=at, depth_mm=depth_mm)) for held, at in asked]
    found = held_light(draft, presses, accuracy="standard")
    change, error = (one / found.untouched for one in (found.flux - found.untouched, found.error))
    both = presses[0].force_n + presses[1].force_n
    words = f"{name}: two balls {np.hypot(*np.subtract(one, other)):.0f} mm apart, {depth_mm:g} mm deep"
    return [
        words,
        size(change[0] + change[1]),
        size(change[2] - change[0] - change[1]),
        rms(np.sqrt(np.sum(error**2, axis=0))),
        f"{100.0 * (presses[2].force_n / both - 1.0):+.2f}",
    ]


TABLES: dict[str, Callable[[], str]] = {
    "contact": contact,
    "balls": balls,
    "light": light,
    "crowns": crowns,
    "symmetry": symmetry,
}


if __name__ == "__main__":
    write_tables(PAGE, "tests/validation/held/object_table.py", TABLES, sys.argv[1:])
