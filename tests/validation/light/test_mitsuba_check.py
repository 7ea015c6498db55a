"""What the comparison with Mitsuba needs no Mitsuba for: its meshes against the oracle's surfaces, and its figures."""

from __future__ import annotations

import numpy as np
import pytest

from optopad.sims.contact.pad_surface import pad_surface
from optopad.sims.optics.scene.optical_scene import smooth_field
from tests.bench.measures.surface_mesh import form_of
from tests.oracle.scene import beyond_walls_mm
from tests.oracle.surface import is_in_elastomer
from tests.oracle.top import lower_presses
from tests.validation.light.mitsuba_check import BEYOND, FLOOR_STATES, STATES, Compared, State, row

OFF_MM = 1e-4
FIELD_STEP_MM = 0.25
SAMPLED = 200
EVERY = (*STATES, *FLOOR_STATES)


@pytest.mark.slow
@pytest.mark.parametrize("state", EVERY, ids=lambda state: state.name)
def test_every_mesh_lies_on_the_surface_that_the_oracle_traces(state: State) -> None:
    """A vertex moved by 0.1 µm along its normal leaves the elastomer, the other way it enters."""
    scene, mesh, (press, field) = state.scene(), state.mesh(step_mm=0.5), state.engines_top()
    if field is not None:
        surface = pad_surface(state.loaded, state.press[2], state.at_mm)
        field = smooth_field(
            lambda x, y: surface.beside_mm(x[:, 0], y[0]), scene.length_mm, scene.width_mm, FIELD_STEP_MM
        )
    top = lower_presses(scene, [state.at_mm], [press], [field])[0]
    used = np.unique(mesh.triangles)
    used = used[beyond_walls_mm(form_of(scene), mesh.vertices[used, :2]).max(axis=1) < -1e-3]
    for k in np.random.default_rng(1).choice(used, SAMPLED, replace=False):
        place, normal = mesh.vertices[k].astype(float), mesh.normals[k].astype(float)
        assert is_in_elastomer(top, *(place - OFF_MM * normal))
        assert not is_in_elastomer(top, *(place + OFF_MM * normal))


@pytest.mark.parametrize("state", [one for one in EVERY if one.press[2] > 0.0], ids=lambda state: state.name)
def test_the_contact_of_every_mesh_ends_at_its_edge(state: State) -> None:
    scene, mesh, (press, _) = state.scene(), state.mesh(step_mm=0.5), state.surface()
    assert press is not None
    origin, axes = form_of(scene).top.press_frame(*state.at_mm)
    radii = [
        np.linalg.norm(((mesh.vertices[part] - origin) @ axes[:2].T), axis=-1)
        for part in (mesh.triangles[: mesh.touched], mesh.triangles[mesh.touched :])
    ]
    assert radii[0].max() == pytest.approx(press.contact_radius_mm, abs=1e-5)
    assert radii[1].min() == pytest.approx(press.contact_radius_mm, abs=1e-5)


@pytest.mark.parametrize("stated", [1e-6, 3e-4], ids=["a sure engine", "an unsure engine"])
def test_a_pair_whose_mirrored_light_is_off_is_named_and_none_where_chance_explains_it(stated: float) -> None:
    random, shape = np.random.default_rng(5), (3, 8, 8)
    light = np.full(shape, 1e-2)
    walk = light + random.normal(0.0, 1e-4, (16, *shape))
    found = Compared(
        engine=light,
        walk=walk,
        stated=np.full((8, 8), stated),
        untouched=light.sum(axis=0),
        judged=np.ones((8, 8), dtype=bool),
        seconds=1.0,
    )
    line, beyond = row(STATES[0], found)
    assert not beyond
    assert float(line[7]) < 1.3
    light[1, 1, 5] += 6e-4  # 2 % of the pair's light
    line, beyond = row(STATES[0], found)
    assert [text.split()[0] for text in beyond] == ["E2-R6"]
    assert (float(line[9].split()[-1]) > BEYOND) == (stated < 1e-4)
    assert line[10].startswith("E2-R6: ")
    assert float(line[10].split()[1]) == pytest.approx(2.0, abs=0.4)
    off, error = found.of_all([1])
    assert off == pytest.approx(6e-4 / walk.mean(axis=0).sum(), abs=3.0 * error)
