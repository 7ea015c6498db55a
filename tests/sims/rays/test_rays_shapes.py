"""Ray pictures of discs and crowned pads: paths start on facets, and the top that mirrors them is the one drawn."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from optopad.design.shape.cavity import cavity_of
from optopad.sims.plots.contact import press_frame
from optopad.sims.plots.rays import cut_of_pair, plot_ray_plan, plot_ray_section
from optopad.sims.press import Indentation
from optopad.sims.rays import RayChoice, RayState, ray_states
from tests.sims.plots.shaped_pads import DOME, made_up_press

PAIR = (0, 3)
AT_MM = (9.0, 8.5)
CAVITY = cavity_of(DOME)


def ending_flat(*asked: Any) -> Indentation:
    """The made-up press with a parabola for its cone, which ends flat as the contact model's curves do."""
    press = made_up_press(*asked)
    tip, edge, reach = press.radius_mm[:40], press.radius_mm[39], press.radius_mm[-1]
    beyond = np.linspace(edge, reach, 400)[1:]
    heights = press.height_mm[39] * ((reach - beyond) / (reach - edge)) ** 2
    return replace(
        press,
        radius_mm=np.concatenate([tip, beyond]),
        height_mm=np.concatenate([press.height_mm[:40], heights]),
    )


@pytest.fixture(scope="module")
def states() -> tuple[RayState, ...]:
    """The dome untouched and under a made-up press; powers are made up, paths are those of the tracer."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("optopad.sims.contact.indent", ending_flat)
        power = SimpleNamespace(by_class={"direct": np.ones((2, 6, 6)), "top": np.ones((2, 6, 6))})
        patch.setattr("optopad.sims.rays._light", lambda *_: power)
        choice = RayChoice(pairs=(PAIR,), count=8, pool_per_path=2, most_rays=200_000, seed=3)
        return ray_states(DOME, choice, [(*AT_MM, 1.0)])


def test_paths_of_a_dome_run_from_facet_to_facet(states):
    for state in states:
        assert state.paths
        for path in state.paths:
            for place, part in (
                (path.places_mm[0], CAVITY.emitters[PAIR[0]]),
                (path.places_mm[-1], CAVITY.receivers[PAIR[1]]),
            ):
                _, outward = part.line.along_and_outward_mm(float(place[0]), float(place[1]))
                assert outward == pytest.approx(0.0, abs=1e-9)


def test_light_is_mirrored_on_the_top_that_is_drawn(states):
    frame = press_frame(DOME, AT_MM)
    for state in states:
        mirrored = [path.places_mm[1:-1] for path in state.paths if path.fate == "top"]
        assert mirrored
        across, aside, over = frame.seen_from_it(np.concatenate(mirrored))
        # the light model's cubic through the points of a curve, to a thousandth of a millimetre
        assert over == pytest.approx(frame.top_mm(state.indentation, across, aside), abs=1e-3)


@pytest.mark.slow
def test_the_section_of_a_dome_is_curved_and_the_press_from_above_an_ellipse(states):
    cut = cut_of_pair(CAVITY, PAIR)
    ax = plot_ray_section(states[0], DOME, cut=cut)
    (surface,) = [line for line in ax.lines if line.get_gid() == "surface"]
    along, height = np.array(surface.get_data())
    places = np.array(cut.start_mm) + along[:, None] * cut.direction
    assert height == pytest.approx([CAVITY.plan.top_mm(x, y) for x, y in places.tolist()])
    assert any(patch.get_gid() == "tip" for patch in plot_ray_section(states[1], DOME, cut=cut).patches)
    (contact,) = [
        patch for patch in plot_ray_plan(states[1], DOME, cut=cut).patches if patch.get_gid() == "contact"
    ]
    width, tall = np.ptp(contact.get_xy(), axis=0)
    normal, radius = CAVITY.plan.normal(*AT_MM), states[1].indentation.contact_radius_mm
    # a disc seen along z reaches as far along an axis as its normal leans away from that axis
    assert width == pytest.approx(2 * radius * (1 - normal[0] ** 2) ** 0.5, rel=3e-3)
    assert tall == pytest.approx(2 * radius * (1 - normal[1] ** 2) ** 0.5, rel=3e-3)
