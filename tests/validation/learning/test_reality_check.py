"""The reality check on made-up light: the same code, seconds in place of an hour."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.press_protocol import load_protocol_file
from optopad.design.shape.cavity import cavity_of
from optopad.sims.learning.learners import LEARNERS, QUICK
from optopad.sims.learning.tables import published_touch
from optopad.sims.readings.press_data import PressCurves
from optopad.sims.readings.protocol import ProtocolCurves, untouched_readout
from tests.validation.learning.reality_check import (
    DESIGN,
    judged_draws,
    pooled,
    touch_misses,
)

pytestmark = pytest.mark.full
SETTINGS = replace(QUICK, search_samples=400, fit_samples=800)


def made_up_curves() -> ProtocolCurves:
    """Every pair dimmed by a press near its chord, the more the deeper: no physics, but all of the machinery."""
    design, protocol = preset(DESIGN), load_protocol_file("piacenza2017-quick")
    cavity = cavity_of(design)
    sets = protocol.places_mm(design)
    places = np.concatenate(sets)
    ends = [
        np.array([part.position_mm[:2] for part in parts]) for parts in (cavity.emitters, cavity.receivers)
    ]
    start, along = ends[0][:, None], ends[1][None] - ends[0][:, None]
    share = np.clip(
        ((places[:, None, None] - start) * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-9), 0.0, 1.0
    )
    away = np.linalg.norm(places[:, None, None] - start - share[..., None] * along, axis=-1)
    depth = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.1])
    dimmed = 0.8 * np.exp(-((away / 4.0) ** 2))[:, None] * (1.0 - np.exp(-depth))[None, :, None, None]
    curves = PressCurves(places_mm=places, depth_mm=depth, flux=2e-3 * (1.0 - dimmed))
    starts = np.cumsum([0, *(len(one) for one in sets)])
    return ProtocolCurves(
        design=design,
        protocol=protocol,
        curves=curves,
        loose=None,
        place_of=tuple(np.arange(a, b) for a, b in pairwise(starts)),
        readout=untouched_readout(design, curves.untouched),
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder, curves = tmp_path_factory.mktemp("reality"), made_up_curves()
    fits = {"kernel-ridge": LEARNERS["kernel-ridge"]}
    return folder, curves, judged_draws(curves, fits, {"kernel-ridge": 2}, folder=folder, settings=SETTINGS)


def test_an_interrupted_check_trains_nothing_twice(made):
    folder, curves, found = made

    def refuses(*_, **__):
        raise AssertionError("trained again")

    again = judged_draws(
        curves, {"kernel-ridge": refuses}, {"kernel-ridge": 2}, folder=folder, settings=SETTINGS
    )
    for key, parts in found.items():
        for one, other in zip(parts, again[key], strict=True):
            np.testing.assert_array_equal(one.said_mm, other.said_mm)


def test_a_row_that_is_off_is_named_with_both_numbers(made):
    found, published = pooled(made[2]), published_touch(preset(DESIGN))
    key = next(iter(found))
    blind = {
        key: replace(
            found[key],
            touch=tuple(replace(row, right=0.5) if row.depth_mm == 1.0 else row for row in found[key].touch),
        )
    }
    assert published is not None
    assert any(
        "at 1 mm: 0.50, the paper 0.98" in text for text in touch_misses(blind, published, "kernel-ridge")
    )
