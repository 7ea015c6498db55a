"""Designs and built molds that several tests look at; each is built once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import cadquery as cq
import numpy as np
import pytest

from optopad.cad.export import part_files
from optopad.cad.mesh import Mesh, read_stl
from optopad.cad.mold import build_mold
from optopad.design.errors import DesignError
from optopad.design.preset import FLAT_PRESETS, PRESETS, preset
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign

FAST = ("piacenza2017-pair", "levi2013-disc", "crowned-40x25")
"""The preset of each kind that is built soonest: flat, a disc, crowned. The others are built in slow tests."""


def presets(names: Sequence[str] = PRESETS) -> list[object]:
    """Parameters of a test that builds the parts of presets."""
    return [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in names]


@dataclass(frozen=True)
class Built:
    """A design and the content of its files."""

    design: SensorDesign
    files: dict[str, bytes]

    @property
    def mold(self) -> Mesh:
        return read_stl(self.files["mold.stl"])

    @cached_property
    def solid(self) -> cq.Workplane:
        """The mold, not yet a mesh."""
        return build_mold(self.design)


@cache
def built_preset(name: str) -> Built:
    design = preset(name)
    return Built(design, part_files(design))


@pytest.fixture(params=presets(FLAT_PRESETS))
def built(request: pytest.FixtureRequest) -> Built:
    return built_preset(request.param)


@pytest.fixture
def pad() -> Built:
    return built_preset("piacenza2017-pad")


@pytest.fixture
def pair() -> Built:
    return built_preset("piacenza2017-pair")


@pytest.fixture
def built_of():
    """Any preset's parts, built once."""
    return built_preset


@pytest.fixture
def random_design():
    return _random_design


def _random_design(seed: int) -> SensorDesign:
    """A usable design drawn from wide ranges; drawn again until it breaks no rule."""
    random = np.random.default_rng(seed)
    while True:
        design = _draw(random)
        try:
            require_valid(design)
        except DesignError:
            continue
        return design


def _draw(random: np.random.Generator) -> SensorDesign:
    length, width = (round(float(random.uniform(14, 90)), 2) for _ in range(2))
    clear = round(float(random.uniform(6, 12)), 2)
    wall = round(float(random.uniform(4, 12)), 2)
    changes = {
        "cavity.length_mm": length,
        "cavity.width_mm": width,
        "cavity.clear_thickness_mm": clear,
        "cavity.black_thickness_mm": float(random.choice([0.0, 1.0, 2.5])),
        "mold.outer_length_mm": length + 2 * wall,
        "mold.outer_width_mm": width + 2 * wall,
        "mold.rim_mm": float(random.choice([0.0, 0.6, 1.5, 3.0])),
        "mold.floor_mm": round(float(random.uniform(1.5, 5)), 2),
        "mold.fixing_hole_diameter_mm": float(random.choice([0.0, 2.2, 3.2])),
        "mold.fixing_hole_inset_mm": round(float(random.uniform(1.5, 5)), 2),
        "emitters.part": str(random.choice(["sunled-xscwd23mb", "generic-emitter"])),
        "receivers.part": str(random.choice(["osram-sfh206k", "generic-receiver"])),
        "emitters.height_mm": round(float(random.uniform(1.5, clear - 1)), 2),
        "receivers.height_mm": round(float(random.uniform(1.0, clear - 1)), 2),
        "layout": [_layout(random)],
        "mold.pieces": "frame_and_base" if random.random() < 0.3 else "one",
        "mold.cover_ledge_mm": float(random.choice([0.0, 0.0, 0.0, 1.0, 2.5])),
        "mold.strain_relief": "none" if random.random() < 0.2 else "pinch",
        "mold.numbers": "none" if random.random() < 0.2 else "engraved",
        "mold.raised_sockets": bool(random.random() < 0.8),
        "mold.label": str(random.choice(["", "A-7"])),
        "board.frame_rate_hz": 10.0,  # slow enough for as many parts as the board has pins for
    }
    return preset("piacenza2017-pad").with_(**changes)


def _layout(random: np.random.Generator) -> dict[str, object]:
    if random.random() < 0.3:
        return {"pattern": "facing_rows", "emitter_wall": "north", "count": int(random.integers(1, 9))}
    sides = [int(n) for n in random.integers(0, 9, 4)]
    sides[0] += sum(sides) % 2 or (2 if sum(sides) == 0 else 0)
    return {"pattern": "alternating_ring", "parts_per_side": sides, "first": "receiver"}
