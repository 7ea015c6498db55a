"""Every exchange of two wires, every dead part and every saturated amplifier of every preset, on the traced pattern."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from optopad.design.preset import FLAT_PRESETS, preset
from optopad.fabrication.driver.check import Verdict, check_frames
from optopad.fabrication.driver.descriptor import Descriptor, descriptor_of
from optopad.fabrication.driver.simulated.board import faults_of
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.driver_file import DriverConfig, config_from_document
from optopad.sensor import simulated_gain
from tests.fabrication.driver.made_up_pad import frame

PART_SPREAD, PAIR_SPREAD = 0.3, 0.12
"""Of the builds, standard deviation of the logarithm: bins and seats of parts, places, the model's error."""
RIGHT_BUILDS = 40
pytestmark = [pytest.mark.slow, pytest.mark.parametrize("name", FLAT_PRESETS)]


@dataclass(frozen=True)
class Traced:
    config: DriverConfig
    found: Descriptor
    untouched: np.ndarray


@cache
def traced(name: str) -> Traced:
    design = preset(name)
    gain = simulated_gain(design, seed=0, on_step=lambda _stage, _share: None)
    text = dump_driver_config(design, gain.counts_per_flux, gain.untouched_readings(design))
    config = config_from_document(tomllib.loads(text), where="driver.toml")
    return Traced(config, descriptor_of(config), gain.untouched_counts())


def checked(name: str, seed: int, *faults: str) -> Verdict:
    """Outcome for a build with its own brightness, gains and places, read ten times."""
    pad, rng = traced(name), np.random.default_rng(seed)
    emitters, receivers = pad.untouched.shape
    parts = rng.standard_normal((emitters, 1)) + rng.standard_normal((1, receivers))
    spread = PART_SPREAD * parts + PAIR_SPREAD * rng.standard_normal(pad.untouched.shape)
    shown = faults_of(pad.config, faults)
    levels = np.vstack([shown.applied(pad.untouched * np.exp(spread)), np.zeros(receivers)]) + 2.0
    levels[:, shown.is_saturated] = np.inf
    noisy = levels + 0.5 * rng.standard_normal((10, *levels.shape))
    return check_frames([frame(counts) for counts in np.clip(np.round(noisy), 0, 1023)], pad.found)


def errors(verdict: Verdict, kind: str) -> list[tuple[str, ...]]:
    return [problem.parts for problem in verdict.problems if problem.is_error and problem.kind == kind]


def test_no_right_build_is_accused(name: str) -> None:
    for seed in range(RIGHT_BUILDS):
        assert [problem for problem in checked(name, seed).problems if problem.is_error] == []


def test_every_exchange_of_two_wires_is_named_once(name: str) -> None:
    found = traced(name).found
    for names in (found.emitters.names, found.receivers.names):
        for seed, pair in enumerate(combinations(names, 2)):
            (parts,) = errors(checked(name, seed, f"swap:{pair[0]},{pair[1]}"), "swapped")
            assert set(pair) <= set(parts)
            if name != "piacenza2017-pair":  # its mirror image explains E1 for E3 by R1 for R3
                assert set(pair) == set(parts)


def test_every_dead_part_and_saturated_amplifier_is_named(name: str) -> None:
    found = traced(name).found
    for seed, part in enumerate((*found.emitters.names, *found.receivers.names)):
        assert errors(checked(name, seed, f"dead:{part}"), "dead") == [(part,)]
    for seed, part in enumerate(found.receivers.names):
        assert (part,) in errors(checked(name, seed, f"saturated:{part}"), "saturated")
