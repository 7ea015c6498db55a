"""Time of the contact model: a press from the library, loading the library, a live solve, an entry of the library, an
object, and the light of an object."""

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.sims.contact import indent
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.profile_library import shipped_library
from optopad.sims.contact.library.smooth_press import POISSON_RATIOS
from optopad.sims.contact.mesh import radial_mesh
from optopad.sims.contact.scope import WALL_RADIUS, contact_of
from optopad.sims.contact.wedge import solve_wedge
from optopad.sims.held import AskedPress, pressed
from optopad.sims.optics.engine.trace_states import trace_scene
from optopad.sims.optics.scene.lower import scene_of
from tests.validation.contact.library_build import entry_inputs


def test_press_from_the_loaded_library(benchmark):
    design = preset("piacenza2017-pad")
    indent(design, 1.0)
    assert benchmark(indent, design, 2.34).force_n > 0.0


def test_press_from_the_library_off_centre(benchmark):
    design = preset("piacenza2017-pad")
    indent(design, 1.0, (7.0, 9.0))
    assert benchmark(indent, design, 2.34, (7.0, 9.0)).force_n > 0.0


def test_press_of_another_layer_each_time(benchmark):
    design = preset("piacenza2017-pad")
    layers = iter(np.linspace(4.0, 15.0, 100_000))

    def press():
        changed = design.model_copy(
            update={"cavity": design.cavity.model_copy(update={"clear_thickness_mm": float(next(layers))})}
        )
        return solved_press(contact_of(changed), 2.0).at(2.0)

    assert benchmark(press).force_n > 0.0


def test_loading_the_library(benchmark):
    assert benchmark(shipped_library.__wrapped__).layers.size > 3


@pytest.mark.slow
def test_coarse_live_solve_to_a_third_of_the_radius(benchmark, bench_size):
    mesh = radial_mesh(3.0, WALL_RADIUS, 0.15)
    depths = np.linspace(1 / 30, 1 / 3, 10)[: bench_size.of(10, 1)]
    assert benchmark.pedantic(solve_wedge, args=(mesh, depths, 0.49), rounds=2).force[-1] > 0.0


@pytest.mark.slow
def test_one_entry_of_the_library(benchmark, bench_size):
    mesh_size, count = bench_size.of((1.0, None), (4.0, 1))
    inputs = [entry_inputs(3.0, ratio) for ratio in POISSON_RATIOS]

    def solve():
        return [
            stored_press._solve(
                replace(one, mesh_size=mesh_size * one.mesh_size, depths=one.depths[:count]), None
            ).force[-1]
            for one in inputs
        ]

    assert min(benchmark.pedantic(solve, rounds=1)) > 0.0


@pytest.mark.parametrize("shear_mm", [None, (0.1, 0.0)])
def test_a_ball_as_an_object_and_its_motion_sideways(benchmark, shear_mm):
    draft = Draft.of(preset("fingertip-16"))
    asked = AskedPress(held=(held_of("sphere,radius=2"),), at_mm=(8.0, 8.0), depth_mm=0.8, shear_mm=shear_mm)
    assert benchmark.pedantic(pressed, (draft, asked), rounds=3, warmup_rounds=1).force_n > 0.0


def test_light_of_an_object(benchmark):
    draft = Draft.of(preset("fingertip-16"))
    press = pressed(draft, AskedPress(held=(held_of("sphere,radius=2"),), at_mm=(8.0, 8.0), depth_mm=0.8))
    scene, tops = scene_of(draft.design), [None, press.top]
    found = benchmark.pedantic(
        trace_scene, (scene, np.zeros((2, 2)), tops), {"accuracy": "score"}, rounds=2, warmup_rounds=1
    )
    assert (found.flux.sum(axis=0)[1] > 0.0).any()
