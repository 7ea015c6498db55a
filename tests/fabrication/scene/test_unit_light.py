"""The light of a manufactured unit, fitted to traced presses of it on top of the map of light of its design."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import optopad
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.design.spec.tolerances import build_tolerances
from optopad.fabrication.scene import unit_light as module
from optopad.fabrication.scene.simulated_pad import SimulatedPad
from optopad.fabrication.scene.unit_light import UnitLight, drawn_design, unit_light
from optopad.sims.robot.fast_light import Imprint
from optopad.sims.robot.shapes import Shape
from tests.fabrication.scene.made_up_scene import (
    DESIGN,
    QUIET,
    Press,
    StandInLight,
    ball,
    flat_imprint,
    pad_body,
    scene,
)
from tests.sims.robot.made_up_light import made_up_light


class OtherUnit(StandInLight):
    """Light of a unit that sees dimples as 1.2 times as deep, and loses other shares of it."""

    def ratios(self, imprint: Imprint) -> np.ndarray:
        spread = 1.0 + 0.3 * np.sin(np.arange(64).reshape(8, 8))
        return np.exp(spread * np.log(super().ratios(imprint.scaled(1.2))))


@pytest.fixture(scope="module")
def unit() -> UnitLight:
    light, truth = StandInLight(), OtherUnit()

    def traced(*_: Any) -> tuple[np.ndarray, Imprint, np.ndarray]:
        imprint = balls(100, seed=1)
        change = truth.ratios(imprint) - light.ratios(imprint)
        return 1.1 * truth.untouched, imprint, change.reshape(100, -1)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_traced", traced)
        return unit_light(light, DESIGN, DESIGN)


def balls(count: int, seed: int) -> Imprint:
    """Imprints of balls at random places and depths."""
    rng, light = np.random.default_rng(seed), StandInLight()
    tip = Shape(kind="sphere", size_mm=np.array([5.0, 0.0, 0.0]))
    height_mm = light.points_mm[0, 2] + 5.0 - rng.uniform(0.1, 2.5, count)
    centre_mm = np.column_stack([rng.uniform(3, 13, (count, 2)), height_mm])
    return light.imprint(tip, centre_mm, np.broadcast_to(np.eye(3), (count, 3, 3)))


def test_a_fitted_unit_is_nearer_to_the_truth_than_its_design(unit: UnitLight) -> None:
    imprint = balls(50, seed=9)
    exact = OtherUnit().ratios(imprint)
    error = module._rms(unit.ratios(imprint) - exact)
    assert unit.factor == pytest.approx(1.2, abs=0.1)
    assert error < 0.3 * module._rms(unit.base.ratios(imprint) - exact)
    assert error < 1.5 * unit.error
    assert unit.error < 0.3 * unit.difference


def test_an_untouched_unit_has_exactly_its_untouched_light(unit: UnitLight) -> None:
    nodes = len(StandInLight().points_mm)
    assert (unit.ratios(flat_imprint(np.full((2, nodes), -0.1))) == 1.0).all()
    nearly = np.full((1, nodes), -0.1)
    nearly[0, 112] = 1e-6
    assert np.abs(unit.ratios(flat_imprint(nearly)) - 1.0).max() < 1e-5
    np.testing.assert_allclose(unit.untouched, 1.1 * StandInLight().untouched)


def test_units_are_drawn_within_the_tolerances_of_the_pad_alone() -> None:
    one, other = (drawn_design(DESIGN, build) for build in (0, 1))
    assert one.digest == drawn_design(DESIGN, 0).digest != other.digest
    assert one.indenter == DESIGN.indenter
    for tolerance in build_tolerances(DESIGN):
        value = one
        for name in tolerance.path.split("."):
            value = value[name] if isinstance(value, dict) else getattr(value, name)
        assert tolerance.low <= float(value) <= tolerance.high or tolerance.path.startswith("part_")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="give a number of 0 or more"):
        drawn_design(DESIGN, -1)


def test_a_design_with_other_parts_is_no_unit_of_this_one() -> None:
    with pytest.raises(InputError, match="other parts than the design"):
        unit_light(StandInLight(), DESIGN, DESIGN.with_(**{"layout.0.parts_per_side": 2}))


def test_a_simulated_unit_keeps_the_configuration_of_its_design(
    unit: UnitLight, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[SensorDesign] = []

    def fitted(_light: StandInLight, _design: SensorDesign, build: SensorDesign) -> UnitLight:
        asked.append(build)
        return unit

    monkeypatch.setattr("optopad.fabrication.scene.simulated_pad.unit_light", fitted)
    optopad.save(DESIGN.with_(**{"cavity.clear_thickness_mm": 5.1}), tmp_path / "design.toml")
    calibrated = optopad.load(tmp_path / "design.toml")  # as `optopad calibrate` writes it
    press = Press(scene(pad_body(), ball()), 8.0, 8.0)
    designed = SimulatedPad(press.model, DESIGN, light=StandInLight())
    one = designed.frame(press.to(1.0)).normalised
    for build in (3, calibrated):
        built = SimulatedPad(press.model, DESIGN, light=StandInLight(), build=build)
        assert built.config == designed.config
        assert np.abs(built.frame(press.to(1.0)).normalised - one).max() > 0.02
    assert asked == [drawn_design(DESIGN, 3), calibrated]


def test_a_thicker_unit_is_touched_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("optopad.fabrication.scene.simulated_pad.unit_light", lambda light, *_: light)
    unit = QUIET.with_(**{"cavity.clear_thickness_mm": 5.1, "cavity.black_thickness_mm": 1.05})
    press = Press(scene(pad_body(design=QUIET), ball()), 8.0, 8.0)
    designed = SimulatedPad(press.model, QUIET, light=StandInLight(QUIET)).frame(press.to(0.5))
    thick = SimulatedPad(press.model, QUIET, light=StandInLight(QUIET), build=unit)
    np.testing.assert_array_equal(thick.frame(press.to(0.35)).counts, designed.counts)
    again = SimulatedPad(press.model, QUIET, light=StandInLight(QUIET)).frame(press.to(0.5))
    np.testing.assert_array_equal(again.counts, designed.counts)


@pytest.mark.slow
def test_traced_states_of_a_unit_differ_from_the_design_s_by_what_was_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "STATES", 9)
    design, light = optopad.load("gripper-teensy"), made_up_light("gripper-teensy")
    untouched, imprint, same = module._traced(light, design, design, seed=0)
    assert (same == 0.0).all()  # light has the same random shifts
    assert len(imprint) == len(same) == 9
    own, _, change = module._traced(light, design, drawn_design(design, 0), seed=0)
    assert 0.005 < module._rms(change) < 0.2
    assert 0.02 < np.abs(own / untouched - 1.0).max() < 1.0
