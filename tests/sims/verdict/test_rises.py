"""Light that rises under a press."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.verdict.causes import rise_of

PAIRS = {"E1-R1": (0, 0), "E1-R2": (0, 1)}


def light(pressed: tuple[float, float], error: float = 0.0) -> LightSignals:
    """Two pairs of 1, untouched and under one press; what changes is mirrored by the smooth top."""
    flux = np.array([[[1.0, 1.0]], [list(pressed)]])
    straight = np.full_like(flux, 0.2)
    dark = np.zeros_like(flux)
    return LightSignals(
        flux=flux,
        by_class={"direct": straight, "top": flux - straight, "skirt": dark, "diffuse": dark},
        standard_error=np.full_like(flux, error),
        presses=np.array([[5.0, 5.0, 0.0], [5.0, 6.0, 3.0]]),
        digest="",
        seed=0,
    )


def test_the_pair_that_rises_most_is_named_with_its_press_and_the_light_that_grows() -> None:
    found = rise_of(light((1.41, 1.2)), PAIRS)
    assert found is not None
    assert (found.pair, found.place_mm, found.depth_mm, found.part) == (
        "E1-R1",
        (5.0, 6.0),
        3.0,
        "smooth top",
    )
    assert np.isclose(found.share, 1.41)
    assert (found.pairs, found.judged) == (2, 2)
    assert "141 % of its untouched" in found.sentence.replace("%", " %")
    assert found.to_json()["pair"] == "E1-R1"


def test_a_rise_within_the_lights_error_or_below_5_percent_is_none() -> None:
    assert rise_of(light((1.41, 0.5), error=0.3), PAIRS) is None
    assert rise_of(light((1.04, 0.5)), PAIRS) is None


def test_a_pair_that_is_dark_untouched_does_not_rise() -> None:
    one = light((0.9, 1.0))
    flux = one.flux.copy()
    flux[:, 0, 1] = [0.001, 0.1]
    assert rise_of(replace(one, flux=flux), PAIRS) is None
