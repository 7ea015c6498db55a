"""Straight light of every preset's pairs, untouched, against the closed form."""

import numpy as np
import pytest

from design.preset import FLAT_PRESETS, preset
from sims.optics.engine.trace_states import CLASS_NAMES, Accuracy, trace_scene
from sims.optics.scene.lower import scene_of
from tests.sims.optics.form_factors import parallel_factor, perpendicular_factor

CHEAP = Accuracy(reference_rays=1024)
NO_LOSS = {"elastomer.absorption_db_per_cm": 0.0}
SOUTH, EAST, NORTH, WEST = range(4)


def lambertian(design):
    """The design without absorption, every emitter Lambertian."""
    parts = {design.emitters.part: {"half_angle_deg": 60.0}}
    return design.with_(part_measurements=parts, **NO_LOSS)


def submerged(patch, height_mm):
    along, z, half_width, half_height = patch
    return (along - half_width, along + half_width), (z - half_height, min(z + half_height, height_mm))


def closed_form(scene, i, j):
    """Flux over the power of the emitter's whole area; 0 on one wall."""
    walls = int(scene.emitter_wall[i]), int(scene.receiver_wall[j])
    (u, z), (v, w) = (
        submerged(patch, scene.height_mm) for patch in (scene.emitter_patch[i], scene.receiver_patch[j])
    )
    share = (z[1] - z[0]) / (2.0 * scene.emitter_patch[i][3])
    if walls[0] == walls[1]:
        return 0.0
    if abs(walls[0] - walls[1]) == 2:
        apart = scene.width_mm if walls[0] in (SOUTH, NORTH) else scene.length_mm
        return share * parallel_factor(u, z, w, v, apart)
    sizes = scene.length_mm, scene.width_mm
    return share * perpendicular_factor(
        from_edge(u, walls[0], walls[1], sizes), z, w, from_edge(v, walls[1], walls[0], sizes)
    )


def from_edge(span, wall, other, sizes):
    """A span along a wall as distances from the corner that it shares with another wall."""
    length = sizes[0] if wall in (SOUTH, NORTH) else sizes[1]
    at_far_end = other in (EAST, NORTH)
    return tuple(sorted((length - a for a in span) if at_far_end else span))


@pytest.mark.parametrize("name", FLAT_PRESETS)
def test_untouched_direct_flux_of_every_pair_equals_the_closed_form(name):
    scene = scene_of(lambertian(preset(name)))
    assert np.allclose(scene.emitter_order, 1.0)
    raw = trace_scene(scene, np.zeros((1, 2)), [None], accuracy=CHEAP)
    found = raw.flux[CLASS_NAMES.index("direct"), 0]
    wanted = np.array(
        [
            [closed_form(scene, i, j) for j in range(len(scene.receiver_wall))]
            for i in range(len(scene.emitter_wall))
        ]
    )
    # near corner pairs are the hardest for the Gauss rule; the acceptance limit is 1e-3
    assert found == pytest.approx(wanted, rel=1e-4, abs=1e-15)
