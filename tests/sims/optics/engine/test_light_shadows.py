"""Whether a leg from the top stays below the top, against the gap sampled densely along it."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.sims.contact.pad_surface import pad_surfaces
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.engine.untouched import packed
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.optics.scene.optical_scene import smooth_field
from optopad.sims.optics.surface.curves import CONTACT_R
from optopad.sims.optics.surface.tops import Top, stack_tops
from tests.bench.measures.benchmark_states import benchmark_scene, benchmark_states
from tests.sims.optics.engine.called_kernels import (
    height,
    height_and_slope,
    height_at,
    is_clear,
    may_be_shaded,
)
from tests.sims.optics.surface.test_light_surface import one_tip

LEGS, SAMPLES = 200, 3000
UNCLEAR_MM = 2e-4
"""A chord of the march's shortest step, 0.02 mm, through the 3 mm tip is 2e-5 mm deep; samples lie as far apart."""


@pytest.mark.parametrize("surface", ["analytic", "contact"])
@pytest.mark.parametrize("depth_index", [0, 2, 5])
def test_a_leg_is_clear_where_the_top_lies_above_it_all_the_way(surface: str, depth_index: int) -> None:
    scene, states = benchmark_scene(), benchmark_states(surface).some([depth_index])
    centre = np.asarray(states.centres_mm)[0]
    row = stack_tops(states.indentations, states.centres_mm, scene, None).rows[0]
    rng = np.random.default_rng(4)
    clear = hidden = 0
    for _ in range(LEGS):
        radius, angle = rng.uniform(row[CONTACT_R] + 0.05, 9.0), rng.uniform(0.0, 2.0 * np.pi)
        start = centre + radius * np.array([np.cos(angle), np.sin(angle)])
        z, turn = height_and_slope(radius * radius, row)
        leg = np.array([*rng.uniform(0.0, 32.0, 2), rng.uniform(0.5, 7.5)]) - [*start, z]
        length = float(np.linalg.norm(leg))
        direction = leg / length
        if direction[2] - turn * (start - centre) @ direction[:2] >= -0.02:
            continue  # it does not go down into the pad
        along = np.linspace(0.02, length, SAMPLES)
        places = start + along[:, None] * direction[:2]
        r2 = ((places - centre) ** 2).sum(axis=1)
        gap = min(height(one, row) - z - t * direction[2] for one, t in zip(r2, along, strict=True))
        if abs(gap) < UNCLEAR_MM:
            continue
        assert is_clear(*start, z, *direction, length, one_tip(row)) == (gap > 0.0)
        clear, hidden = clear + (gap > 0.0), hidden + (gap < 0.0)
    assert clear > LEGS // 10
    assert hidden > 3


@pytest.mark.parametrize("place_mm", [(16.0, 16.0), (6.0, 6.0)])
def test_a_face_that_is_told_to_be_in_view_has_no_line_through_the_top(place_mm: tuple[float, float]) -> None:
    pad = Pad.of(preset("piacenza2017-pad"))
    scene = scene_of(pad.design)
    box, emitters, _ = packed(scene)
    presses = np.array([[*place_mm, depth] for depth in (0.3, 2.5, 4.9)])
    rng = np.random.default_rng(7)
    told = 0
    for press, surface in zip(presses, pad_surfaces(contact_of(pad.design), presses), strict=True):
        field = smooth_field(
            lambda x, y, surface=surface: surface.beside_mm(x[:, 0], y[0]), 32.0, 32.0, 0.75, 2
        )
        (row,), cells = stack_tops([surface.near], press[None, :2], scene, [field]).part(np.arange(1))
        top = Top(row, cells[0])
        for face in emitters:
            wall, along, z, half_width, half_height = face[:5]
            for x, y in rng.uniform(0.5, 31.5, (40, 2)):
                if np.hypot(x - press[0], y - press[1]) < row[CONTACT_R]:
                    continue
                start = np.array([x, y, height_at(x, y, top)])
                if may_be_shaded(*start, face, box, top):
                    continue
                told += 1
                a = along + half_width * rng.uniform(-1.0, 1.0, 6)
                here = {0: (a, 0 * a), 1: (0 * a + 32.0, a), 2: (a, 0 * a + 32.0), 3: (0 * a, a)}[int(wall)]
                for x1, y1 in zip(*here, strict=True):
                    line = start + np.linspace(0.0, 1.0, 150)[:, None] * ([x1, y1, z + half_height] - start)
                    assert min(height_at(px, py, top) - pz for px, py, pz in line) > -UNCLEAR_MM
    assert told > 400
