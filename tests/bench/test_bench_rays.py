"""What the view of the light costs the main job: paths and powers on the paper's pad, kernels compiled."""

from __future__ import annotations

from optopad.design.preset import preset
from optopad.report.scenes.ray_scene import ray_scene
from optopad.report.sections.rays import rays_section
from tests.sims.made_up_scores import dead_score


def test_paths_and_powers_of_the_reports_view(benchmark):
    design = preset("piacenza2017-pad")
    score = dead_score(design)
    scene = benchmark.pedantic(ray_scene, (design, score), {"seed": 0}, rounds=5, warmup_rounds=1)
    section = rays_section(scene)
    benchmark.extra_info["kilobytes"] = len(section.encode()) / 1000
    assert len(scene.states) == 6
