"""Two tips at once: the stored solutions, the model against them, and the solver's planes of symmetry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from optopad.design.arrays import FloatArray
from tests.validation.contact.contact_reference import POISSON_RATIO
from tests.validation.held import object_press
from tests.validation.held.rounded_objects import Distance
from tests.validation.held.test_object_table import require_same
from tests.validation.held.tips_table import HEAD, PAGE, contact_row, stored
from tests.validation.held.tips_truth import APART_MM, CASES, TipPress, TipsCase
from tests.validation.stored import ROOT, table

FORCE = "force/E [mm2]"


def test_meshes_agree_and_balls_load_each_other() -> None:
    assert list(stored()) == [
        (case.apart_mm, depth, case.is_alone) for case in CASES.values() for depth in case.depths_mm
    ]
    for (apart, depth, is_alone), rows in stored().items():
        for name, row in rows.items():
            if name == FORCE:
                assert abs(row.mesh_error) < 0.005 * row.value
            elif name.startswith("height") and "edge + 0.5" not in name:
                assert abs(row.mesh_error) < 0.005 * depth, (apart, depth, name)
        if is_alone:
            continue
        alone = stored()[apart, depth, True]
        assert 1.0 < rows[FORCE].value / alone[FORCE].value < 1.06
        if apart == min(APART_MM):  # the top between near balls is pulled down by both
            middle = "height at inward = middle mm [mm]"
            assert rows[middle].value < alone[middle].value
            inward, outward = (
                rows[f"contact half width along {way} [mm]"].value for way in ("inward", "outward")
            )
            assert inward < outward


def test_every_row_of_contact_is_what_the_command_makes() -> None:
    rows = iter(table(PAGE.relative_to(ROOT).as_posix(), *HEAD))
    for apart, depth in [key for *key, is_alone in stored() if not is_alone]:
        require_same(contact_row(apart, depth), list(next(rows).values()))
    assert not list(rows), "renew: python -m tests.validation.held.tips_table contact"


@dataclass(frozen=True)
class BothBalls:
    """The ball of a case and its image across x = 0."""

    case: TipsCase

    def distance(self, places: FloatArray) -> Distance:
        """As `RoundedBox.distance`."""
        turn = np.ones(places.shape)
        turn[..., 0] = np.where(places[..., 0] < 0.0, -1.0, 1.0)
        found = self.case.thing.distance(turn * places - (0.5 * self.case.apart_mm, 0.0, 0.0))
        return found[0], turn * found[1], turn[..., :, None] * found[2] * turn[..., None, :]


@pytest.mark.full
def test_half_a_pad_with_both_balls_presses_like_the_quarter_with_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(object_press, "REACH_MM", 20.0)  # the same faces of the top may touch in both
    case = replace(CASES["two balls, 7.5 apart"], coarser=(2.5,))
    (quarter,) = case.presses()
    x, y, z = case.ticks(2.5)
    along = x + 0.5 * case.apart_mm
    ticks = np.concatenate([-along[:0:-1], along]), y, z
    half = TipPress(BothBalls(case), ticks, POISSON_RATIO, case.penalty, (1,))
    for press in (quarter, half):
        press.advance(0.8)
    one, both = (press.read() for press in (quarter, half))
    assert one.reaction == pytest.approx(-one.force, rel=1e-8)
    assert both.force == pytest.approx(2.0 * one.force, rel=1e-8)
    tops = []
    for press, read, axis_mm in ((quarter, one, 0.0), (half, both, 0.5 * case.apart_mm)):
        rest = np.round(press.solid.nodes[:2, press.top_nodes] - [[axis_mm], [0.0]], 9)
        order = np.lexsort(rest)
        order = order[rest[0, order] >= -0.5 * case.apart_mm]
        tops.append(read.top[order] - (axis_mm, 0.0, 0.0))
    assert tops[1] == pytest.approx(tops[0], abs=1e-7)
