"""A small hidden build, traced: the calibrated twin has the light of the build (docs/validation has whole ones)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.design.press_protocol import protocol_from
from optopad.design.shape.cavity import cavity_of
from optopad.sims.learning.calibration import calibrated
from optopad.sims.learning.calibration_problem import unknowns_of, with_values
from optopad.sims.optics.tracing import trace
from optopad.sims.readings.protocol import draw, protocol_curves
from optopad.sims.readings.signal_chain import chain_of

FITTED = ("emitters.height_mm", "receivers.height_mm")
PROTOCOL = protocol_from(
    {
        "name": "nine-presses",
        "approach": [
            {"from_mm": -1.0, "to_mm": 0.0, "step_mm": 0.25},
            {"from_mm": 0.5, "to_mm": 2.5, "step_mm": 1.0},
        ],
        "retract": "none",
        "curves": "coarse",
        "sets": [{"name": "bench", "role": "train", "is_ambient": False, "grid_mm": 10.0}],
    },
    where="nine-presses",
)


def with_two_unknowns():
    """The paper's pad of which all is known but the heights, so that a few traces tell."""
    design = preset("piacenza2017-pad")
    others = {one.path: 0.0 for one in unknowns_of(design) if one.path not in FITTED}
    return design.with_(tolerances=others)


def test_a_value_said_to_be_exact_is_not_fitted():
    assert tuple(one.path for one in unknowns_of(with_two_unknowns())) == FITTED


@pytest.mark.full
def test_heights_of_a_hidden_build_come_back_and_its_light_with_them():
    design = with_two_unknowns()
    unknowns = unknowns_of(design)
    hidden = with_values(design, unknowns, np.array([5.14, 5.83]))
    curves = protocol_curves(hidden, PROTOCOL, seed=7, is_coarse=True)
    chain = chain_of(hidden, curves.readout)
    power = 1.0 + 0.1 * np.random.default_rng(1).normal(size=(len(cavity_of(design).emitters), 1))
    data = replace(
        draw(curves, replace(chain, gains=chain.gains * power), seed=1), design_digest=design.digest
    )
    found = calibrated(design, data)
    # 27 readings of 64 pairs: the light changes by 15 % a tenth of a millimetre, the model is good to 0.4 %
    assert np.abs(found.values - [5.14, 5.83]).max() < 0.03
    assert found.fitted.rms[1] < 1.5 < found.fitted.rms[0]
    place = np.random.default_rng(2).uniform(7.0, 25.0, size=(6, 2))
    presses = np.column_stack([place, np.linspace(0.5, 4.0, 6)])
    truth, twin, drawn = (
        trace(Draft.of(one), presses, accuracy="draft", seed=3).flux for one in (hidden, found.design, design)
    )
    off = [np.sqrt(((one / one.mean() - truth / truth.mean()) ** 2).mean()) for one in (twin, drawn)]
    assert off[0] < 0.2 * off[1]


def test_unknowns_have_names_without_their_units():
    words = {one.unit: one.words for one in unknowns_of(preset("piacenza2017-pad"))}
    assert words["dB/cm"] == "elastomer absorption"
    assert words["deg"] == "LED half angle"
    assert words["mm"] == "cavity clear thickness"
