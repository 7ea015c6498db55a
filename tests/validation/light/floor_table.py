"""Light of parts on the floor against the oracle, pair by pair: `python -m tests.validation.light.floor_table`.

Pads with emitters and receivers on the floor, bare or under a skin, untouched and pressed by a ball or a cylinder.
Parts look up, flush with the floor or above it, or stand and look level. Both trace the same tops, so the table tests
the light alone. The oracle runs in batches of rays; interrupted, it goes on.

Columns of the table
--------------------
- worst: the pair that is off most, in joint standard errors of engine and oracle; rms of these errors over all pairs
- all: how far the sum over all pairs is off, and the oracle's standard error of it
- change by the press, the oracle's standard error, and the engine's: over the untouched signal, rms over pairs that are
  not dim (`tests.validation.light.shapes_table`)
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.held_object import Cylinder
from optopad.design.io import without_empty
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.contact.held.bottoms import bottom_mm
from optopad.sims.contact.held.press import grid_of, held_press
from optopad.sims.contact.pad_surface import pad_surface
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import GridTop, Indentation
from tests.validation.contact.contact_table import markdown_table
from tests.validation.light.shapes_table import DIM, compared, oracle_batches

BASE = "crowned-40x25"
"""The preset from which the pads differ."""
EMITTER, RECEIVER = "vishay-vsmb1940x01", "osram-sfh2400"
FLAT: dict[str, Any] = {
    "cavity": {"length_mm": 30.0, "width_mm": 24.0, "clear_thickness_mm": 5.0, "black_thickness_mm": 0.7},
    "crown": None,
    "mold": {"outer_length_mm": 42.0, "outer_width_mm": 36.0},
    "emitters": {"part": EMITTER, "height_mm": None},
    "receivers": {"part": RECEIVER, "height_mm": None},
    "layout": [{"pattern": "checkerboard", "columns": 4, "rows": 3, "pitch_mm": 6.0}],
    "operating": {"max_depth_mm": 2.0},
}
FLUSH_EMITTERS: dict[str, Any] = {"cavity": FLAT["cavity"] | {"black_thickness_mm": 0.85}}
FLUSH_RECEIVERS: dict[str, Any] = {"receivers": {"part": "vishay-vemd4110x01", "height_mm": None}}
"""The black layer is as thick as the bodies of one kind are high, so their faces are in the floor."""
PADS: dict[str, dict[str, Any]] = {
    "flat, bare": FLAT,
    "flat, emitters flush, bare": FLAT | FLUSH_EMITTERS,
    "flat, specular 0.8": FLAT | {"top": {"finish": "specular", "reflectance": 0.8}},
    "flat, receivers flush, diffuse 0.6": FLAT
    | FLUSH_RECEIVERS
    | {"top": {"finish": "diffuse", "reflectance": 0.6}},
    "cylinder of 60 mm, bare": FLAT
    | {
        "cavity": FLAT["cavity"] | {"clear_thickness_mm": 6.0},
        "crown": {"shape": "cylinder", "radius_mm": 60.0, "axis": "x"},
    },
    "disc, level, specular 0.8": FLAT
    | {
        "cavity": {"outline": "disc", "length_mm": None, "width_mm": None, "diameter_mm": 28.0}
        | {"clear_thickness_mm": 5.0, "black_thickness_mm": 0.2},
        "mold": {"outer_length_mm": None, "outer_width_mm": None, "outer_diameter_mm": 42.0},
        "layout": [{"pattern": "ring_inside", "emitters": 5, "receivers": 5, "inset_mm": 4.0, "looks": "in"}],
        "top": {"finish": "specular", "reflectance": 0.8},
    },
}
"""What differs from `BASE`, by section."""
CYLINDER = "cylinder"
PRESSES: dict[str, tuple[tuple[float, float, float], ...]] = {
    "": ((0.0, 0.0, 1.0), (4.0, -2.5, 2.0)),
    CYLINDER: ((-3.0, 1.0, 0.8),),
}
"""x, y from the middle of the pad, and depth [mm], of the tip and of a cylinder of `HELD`."""
WITH_CYLINDER = ("flat, bare", "flat, specular 0.8", "flat, receivers flush, diffuse 0.6")
HELD = Cylinder(radius=4.0, length=9.0, edge=2.0, yaw=30.0)
ACCURACY = "standard"
RAYS, BATCHES = 250_000, 8
TABLE = Path(__file__).with_name("floor_table.md")
HEAD = """# Light of parts on the floor against the oracle

Made by `python -m tests.validation.light.floor_table`, which says what the pads and the columns are. Each emitter sends
{rays:g} million rays in each state.

"""


@cache
def design_of(name: str) -> SensorDesign:
    """One of `PADS`."""
    document = preset(BASE).model_dump(mode="json")
    for section, values in PADS[name].items():
        before = document.get(section)
        is_part = isinstance(before, dict) and isinstance(values, dict)
        document[section] = before | values if is_part else values
    return SensorDesign.from_document(without_empty(document | {"name": "floor"}), where=name)


def states_of(
    name: str, scene: OpticalScene
) -> list[tuple[str, tuple[float, float], Indentation | GridTop | None]]:
    """Name, place [mm] and top of each state; the untouched one is the first."""
    contact = contact_of(design_of(name))
    middle = scene.length_mm / 2.0, scene.width_mm / 2.0
    found: list[tuple[str, tuple[float, float], Indentation | GridTop | None]] = [("untouched", middle, None)]
    for kind, presses in PRESSES.items():
        for along, across, depth in presses if kind == "" or name in WITH_CYLINDER else ():
            at = middle[0] + along, middle[1] + across
            title = f"{kind} {depth:g} at {at[0]:g}, {at[1]:g}".strip()
            if kind == "":
                found.append((title, at, pad_surface(design_of(name), depth, at).near))
            else:
                x, y = grid_of(contact, at)
                found.append((title, at, held_press(contact, at, bottom_mm(HELD, x, y), depth_mm=depth).top))
    return found


def rows(name: str, rays: int = RAYS, count: int = BATCHES) -> Iterator[list[str]]:
    """A row for each state of a pad."""
    scene = scene_of(design_of(name))
    titles, places, tops = zip(*states_of(name, scene), strict=True)
    centres = np.array(places)
    batches = oracle_batches(f"floor-{name.replace(' ', '')}", scene, centres, list(tops), rays, count)
    seen = batches.mean(axis=0).sum(axis=(1, 2))
    raw = trace_scene(scene, centres, list(tops), accuracy=ACCURACY)
    flux: FloatArray = raw.flux.sum(axis=0)
    untouched = flux[0]
    bright = untouched >= DIM * untouched.max()
    for state, title in enumerate(titles):
        row = compared(flux, raw.standard_error, flux, batches, state, rays)
        every = flux[state].sum() / seen[state] - 1.0
        counted = np.sqrt(flux[state] / (rays * count))
        shares = np.array([flux[state] - untouched, counted, raw.standard_error[state]])[:, bright]
        yield [
            name,
            title,
            f"{row.worst:.1f}",
            f"{row.spread:.2f}",
            f"{100.0 * every:+.2f}, {100.0 / np.sqrt(seen[state] * rays * count):.2f}",
            *(f"{100.0 * np.sqrt(np.mean((share / untouched[bright]) ** 2)):.2f}" for share in shares),
        ]


def table(names: tuple[str, ...] = tuple(PADS), count: int = BATCHES) -> str:
    """The table as Markdown, from a number of batches."""
    head = ["pad", "press mm", "worst pair, joint standard errors", "rms of these", "all: off, error %"]
    head += ["change %", "the oracle's error %", "stated error %"]
    body = [row for name in names for row in rows(name, count=count)]
    return HEAD.format(rays=RAYS * count / 1e6) + markdown_table(head, body) + "\n"


def main(names: list[str]) -> None:
    """Write the table beside this file; of the named pads only, print it."""
    if names:
        sys.stdout.write(table(tuple(names)))
    else:
        TABLE.write_text(table(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
