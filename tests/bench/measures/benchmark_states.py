"""The benchmark of the light model: one scene, 18 places x 6 depths, two families of surfaces.

The scene is `light-benchmark.toml` beside this file. Places are drawn once, evenly over the square of 5 to 27 mm, so
that every tip stays 2 mm and more from the walls and no place is special. Depths are 0.5 to 5 mm.

Surfaces: `analytic` is a sphere with a compact cubic skirt (`tests.sims.optics.surface.analytic`), which ends 7 mm from
the axis at most; `contact` is what the contact model gives for this pad, curved out to the walls.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.io import load_design
from optopad.design.spec import SensorDesign
from optopad.sims.contact import indent
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import OpticalScene
from optopad.sims.press import Indentation
from tests.sims.optics.surface.analytic import compact_dimple

DESIGN_FILE = Path(__file__).with_name("light-benchmark.toml")
DEPTHS_MM = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0)
PLACE_COUNT = 18
PLACE_RANGE_MM = (5.0, 27.0)
PLACE_SEED = 3
SURFACES = ("analytic", "contact")


@dataclass(frozen=True, kw_only=True)
class BenchmarkStates:
    """Presses of one family of surfaces, place by place, each at all depths.

    Attributes
    ----------
    centres_mm : (state, 2) press axes [mm]
    indentations : one per state; states of one depth share one object
    """

    centres_mm: FloatArray
    indentations: list[Indentation]

    def some(self, wanted: list[int]) -> BenchmarkStates:
        """These states only, in this order."""
        return BenchmarkStates(
            centres_mm=self.centres_mm[wanted], indentations=[self.indentations[k] for k in wanted]
        )


@cache
def benchmark_design() -> SensorDesign:
    """The named design."""
    return load_design(DESIGN_FILE)


def benchmark_scene() -> OpticalScene:
    """Its optical scene."""
    return scene_of(benchmark_design())


def different_walls(scene: OpticalScene) -> BoolArray:
    """(emitter, receiver) whether a pair faces each other from two walls: the pairs that are judged."""
    return np.asarray(scene.emitter_wall[:, None] != scene.receiver_wall[None, :])


def places_mm() -> FloatArray:
    """(18, 2) press axes [mm]."""
    return np.random.default_rng(PLACE_SEED).uniform(*PLACE_RANGE_MM, (PLACE_COUNT, 2))


def surface_of(surface: str) -> Callable[[float], Indentation]:
    """The press of a family by its depth [mm]."""
    return {"analytic": compact_dimple, "contact": lambda depth_mm: indent(benchmark_design(), depth_mm)}[
        surface
    ]


def benchmark_states(surface: str) -> BenchmarkStates:
    """The 108 states of a family of surfaces."""
    presses = [surface_of(surface)(depth_mm) for depth_mm in DEPTHS_MM]
    places = places_mm()
    return BenchmarkStates(
        centres_mm=np.repeat(places, len(DEPTHS_MM), axis=0), indentations=presses * len(places)
    )


def pad_scan(surface: str, along: int = 11, depths: int = 51) -> tuple[FloatArray, list[Indentation | None]]:
    """(state, 2) centres [mm] and presses of a whole pad: along² places 2 mm apart, depths from 0 to 5 mm.

    121 places x 51 depths by default.
    """
    ticks = np.linspace(6.0, 26.0, along)
    places = np.array([(x, y) for x in ticks for y in ticks])
    press = surface_of(surface)
    presses = [press(float(depth)) if depth > 0.0 else None for depth in np.linspace(0.0, 5.0, depths)]
    return np.repeat(places, depths, axis=0), presses * len(places)
