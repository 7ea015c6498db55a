"""The rules refuse what the mold builder refuses: both compute the same webs from the same numbers.

Four of the builder's clearances are left out. The pour lip widens the cavity's mouth by at most 1.5 mm,
so a fixing hole may pass the rules and not the builder there. Three cannot be the only ones to break: a
pocket below the fill level (its part would be above the surface), neighbouring wire slots (they join
when too near), and a lead hole near the outer face (its pocket reaches further out).
"""

from __future__ import annotations

import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from design.catalog import packaged
from design.rules import check
from design.spec import SensorDesign
from design.webs import clearances
from tests.design.spec_fields import with_layout

LIP = "fixing hole to cavity"
SLACK_MM = 0.01
"""A web this near to its need may fall on either side: messages round to it."""
EMITTERS = sorted(name for name, part in packaged().parts.items() if part.kind == "emitter")
RECEIVERS = sorted(name for name, part in packaged().parts.items() if part.kind == "receiver")


def rows() -> st.SearchStrategy[dict[str, Any]]:
    counts = st.integers(0, 3)
    return st.fixed_dictionaries(
        {
            "pattern": st.just("per_side"),
            "kind": st.sampled_from(["emitter", "receiver"]),
            "south": counts,
            "east": counts,
            "north": counts,
            "west": counts,
            "shift_mm": st.floats(-6.0, 6.0),
        }
    )


def molds() -> st.SearchStrategy[dict[str, float]]:
    return st.fixed_dictionaries(
        {
            "mold.outer_length_mm": st.floats(37.0, 60.0),
            "mold.outer_width_mm": st.floats(37.0, 60.0),
            "mold.floor_mm": st.floats(0.6, 4.0),
            "mold.fixing_hole_inset_mm": st.floats(1.0, 8.0),
            "mold.fixing_hole_diameter_mm": st.sampled_from([0.0, 2.5, 3.2]),
            "emitters.part": st.sampled_from(EMITTERS),
            "receivers.part": st.sampled_from(RECEIVERS),
            "emitters.height_mm": st.floats(2.0, 7.0),
            "receivers.height_mm": st.floats(2.0, 7.0),
        }
    )


SAME = {
    "wall": "walls are too thin",
    "pocket back to outer face": "walls are too thin",
    "pocket to corner": "reaches into the end",
    "pocket to pocket": "the bodies of|the web between the sockets",
    "floor under pocket": "the floor below the socket",
    "fixing hole to outer face": "a fixing hole and the outer face",
    "pocket to fixing hole": "a fixing hole and the socket",
    "wire slot to fixing hole": "a fixing hole and the socket",
    "lead hole to fixing hole": "a fixing hole and the socket",
    "fixing hole to fixing hole": "a fixing hole and the next fixing hole",
    "lead hole to lead hole": "between the lead holes",
    "lead hole to cavity": "from the lead holes to the cavity",
    "lead hole to pocket edge": "from the lead holes to the socket's edge",
}
"""The builder's name of a clearance, and the rules' words for it."""


def refused_by_rules(design: SensorDesign) -> set[str]:
    """The words of `SAME` that the errors of a design hold."""
    errors = [finding.message for finding in check(design) if finding.severity == "error"]
    return {words for words in SAME.values() if any(re.search(words, message) for message in errors)}


def refused_by_builder(design: SensorDesign) -> set[str]:
    """The same words for what the builder finds too tight."""
    return {SAME[one.name] for one in clearances(design) if not one.is_kept and one.name in SAME}


@settings(max_examples=200)
@given(st.lists(rows(), min_size=1, max_size=2), molds())
def test_rules_and_builder_refuse_the_same_webs(layout: list[dict[str, Any]], mold: dict[str, float]) -> None:
    ends = [
        {"pattern": "single", "kind": "emitter", "wall": "south", "along_mm": 16.0},
        {"pattern": "single", "kind": "receiver", "wall": "north", "along_mm": 16.0},
    ]
    design = with_layout(*layout, *ends, **mold)
    if all(abs(one.spare_mm) >= SLACK_MM for one in clearances(design)):
        assert refused_by_rules(design) == refused_by_builder(design)


def test_every_clearance_of_the_builder_is_compared_but_the_lip_and_three() -> None:
    names = {
        one.name for one in clearances(with_layout({"pattern": "alternating_ring", "parts_per_side": 4}))
    }
    assert names - set(SAME) == {
        LIP,
        "pocket below fill level",
        "wire slot to wire slot",
        "lead hole to outer face",
    }
