"""Light of parts on the floor, and under skins, against the oracle."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from optopad.sims.optics.engine.trace_states import trace_scene
from tests.oracle.floor_scenes import (
    EMITTERS,
    RECEIVERS,
    TILTED_EMITTERS,
    TILTED_RECEIVERS,
    crowned_floor_scene,
    floor_scene,
)
from tests.oracle.form_scenes import crown_press
from tests.oracle.oracle_scenes import dimple
from tests.oracle.tracer import trace_oracle

RAYS = 250_000
SCENES = {
    "bare": lambda: floor_scene(),
    "specular": lambda: floor_scene("specular", 0.8),
    "diffuse": lambda: floor_scene("diffuse", 0.6),
    "crowned": lambda: crowned_floor_scene("specular", 0.8),
    "tilted": lambda: floor_scene(
        "specular", 0.8, emitters=TILTED_EMITTERS, receivers=TILTED_RECEIVERS, wall_reflectance=0.2
    ),
}
BETWEEN = (EMITTERS[0][0] + RECEIVERS[0][0]) / 2.0, (EMITTERS[0][1] + RECEIVERS[0][1]) / 2.0
PLACES = {"untouched": (10.0, 8.0), "off every image": (12.0, 9.5), "between a pair": BETWEEN}


@cache
def pulls(name):
    """(state, pair) differences of engine and oracle, their joint standard errors, and the untouched light [-]."""
    scene = SCENES[name]()
    press = crown_press(1.5, 80.0, 0.05) if name == "crowned" else dimple(1.5, 0.05)
    places, tops = np.array([*PLACES.values()]), [None, press, press]
    raw = trace_scene(scene, places, tops, accuracy="standard")
    known = trace_oracle(scene, places, tops, rays=RAYS, seed=4)
    engine = raw.flux.sum(axis=0).reshape(3, -1)
    counted = np.sqrt(np.maximum(known.without_crossing.reshape(3, -1), engine) / RAYS)
    off = engine - known.without_crossing.reshape(3, -1)
    return off, np.hypot(counted, raw.standard_error.reshape(3, -1)), counted, engine[0]


@pytest.mark.slow
@pytest.mark.parametrize("state", range(3), ids=[*PLACES])
@pytest.mark.parametrize("name", SCENES)
def test_light_of_parts_on_the_floor_is_the_oracle_s(name, state):
    off, error, counted, untouched = pulls(name)
    assert np.abs(off[state] / error[state]).max() < 4.5
    assert abs(off[state].sum()) < 4.5 * np.hypot(
        *(np.sqrt(np.sum(one[state] ** 2)) for one in (error, counted))
    )
    assert error[state].max() < 0.1 * untouched.max()  # an engine that is unsure of everything does not pass
