"""Why depth is not told: made-up light with one thing missing at a time, and the paper's pair at 10 mm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from optopad.design.preset import preset
from optopad.design.shape.cavity import cavity_of, chord_midpoint_mm, direct_path_pairs, facing_pairs
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.optics.scene.lower import scene_of
from optopad.sims.readings.readout import Readout
from optopad.sims.score.scoring import score
from optopad.sims.verdict.causes import GONE, WHOLE, causes_of_pad, causes_of_pairs
from optopad.sims.verdict.pad_map import PadMap, Place
from tests.oracle.pressed import pressed_tops
from tests.oracle.tracer import CLASSES, trace_oracle
from tests.sims.made_up_scores import FULL_SCALE, UNTOUCHED_FLUX, made_up_depths, made_up_pair

PAIR, PAD = preset("piacenza2017-pair"), preset("piacenza2017-pad")
MIDDLE = facing_pairs(cavity_of(PAIR))[0]


def caused(counts: float = 300.0, **light: float):
    """Causes of one pair with made-up light, and the pair."""
    one = made_up_pair(
        counts=counts, pair=MIDDLE, press_mm=chord_midpoint_mm(cavity_of(PAIR), MIDDLE), **light
    )
    readout = Readout(
        counts_per_flux=counts / float(one.curves.total[0]),
        full_scale_counts=FULL_SCALE,
        read_noise_counts=0.5,
        relative_noise=0.003,
    )
    return causes_of_pairs(PAIR, [(one.curves, one.score)], readout, one.name), one


def test_modes_too_far_apart():
    (cause, *_), one = caused(mode1_end_mm=0.7, onset_mm=3.0, last_mm=6.0)
    assert (cause.kind, cause.lack) == ("deadband", "apart")
    assert cause.depth_mm == one.score.deadbands_mm[0]
    assert cause.short_mm == pytest.approx(one.score.modes.gap_mm)
    (witness,) = cause.witnesses
    assert witness.pair == "E2-R2"
    assert witness.straight == pytest.approx(1.0)
    assert witness.mirrored < 0.1
    # 8 mm of clear layer, halfway between upper edges at 5 + 1 and 6 + 1.3 mm
    receiver = cavity_of(PAIR).receivers[MIDDLE[1]]
    assert witness.reach_mm == pytest.approx(8.0 - 0.5 * (6.0 + 6.0 + receiver.half_height_mm))


def test_light_used_up_before_the_deepest_press():
    causes, one = caused(mode1_end_mm=0.7, onset_mm=0.4, last_mm=3.0)
    assert [(cause.kind, cause.lack) for cause in causes] == [("fade", "used up")]
    assert causes[0].depth_mm == one.score.saturation_mm
    assert causes[0].short_mm == pytest.approx(5.0 - one.score.modes.mode2_mm[1])
    assert causes[0].witnesses[0].straight <= GONE


def test_a_reading_at_full_scale():
    causes, _ = caused(counts=3000.0, mode1_end_mm=0.7, onset_mm=1.4, last_mm=4.9)
    assert {cause.lack for cause in causes if cause.depth_mm[0] < 1.0} == {"clipped"}


def test_too_little_light():
    causes, _ = caused(counts=2.0, mode1_end_mm=0.7, onset_mm=1.4, last_mm=4.9)
    assert {cause.lack for cause in causes} == {"dim"}
    assert causes[0].short_mm is None


def test_a_rise_that_makes_up_for_a_fall():
    one = made_up_pair(pair=MIDDLE, mode1_end_mm=0.7, onset_mm=3.0, last_mm=6.0)
    flat = np.full_like(one.curves.total, UNTOUCHED_FLUX)
    direct = 0.6 * flat * (1.0 + 0.05 * one.curves.depth_mm)
    curves = replace(one.curves, direct=direct, top=flat - direct, diffuse=0.0 * flat, total=flat)
    judged = replace(one.score, deadbands_mm=((1.0, 3.0),), saturation_mm=None)
    readout = Readout(
        counts_per_flux=300.0 / UNTOUCHED_FLUX,
        full_scale_counts=FULL_SCALE,
        read_noise_counts=0.5,
        relative_noise=0.003,
    )
    (cause,) = causes_of_pairs(PAIR, [(curves, judged)], readout, one.name)
    assert cause.lack == "cancel"
    assert cause.witnesses[0].change == pytest.approx(0.0)


def pad_causes(keep_pairs: bool):
    """Causes of a pad of one place whose pairs all have the same made-up light, or none under the tip."""
    cavity = cavity_of(PAD)
    one = made_up_pair(mode1_end_mm=0.7, onset_mm=3.0, last_mm=6.0).curves
    shape = (len(one.depth_mm), len(cavity.emitters), len(cavity.receivers))
    lit = direct_path_pairs(cavity) if keep_pairs else np.zeros(shape[1:], dtype=bool)

    def spread(values: np.ndarray) -> np.ndarray:
        return values[:, None, None] * lit

    presses = np.column_stack([np.full_like(one.depth_mm, 16.0)] * 2 + [one.depth_mm])
    light = LightSignals(
        flux=spread(one.total),
        by_class={
            "direct": spread(one.direct),
            "top": spread(one.top),
            "skirt": np.zeros(shape),
            "diffuse": spread(one.diffuse),
        },
        standard_error=np.zeros(shape),
        presses=presses,
        digest="",
        seed=0,
    )
    blind = made_up_depths(((1.5, 2.5),), usable_mm=4.0)
    place = Place(x_mm=16.0, y_mm=16.0, depths=blind, answering_pairs=9)
    readout = Readout(
        counts_per_flux=300.0 / UNTOUCHED_FLUX,
        full_scale_counts=FULL_SCALE,
        read_noise_counts=0.5,
        relative_noise=0.003,
    )
    return causes_of_pad(PAD, PadMap(x_mm=(16.0,), y_mm=(16.0,), places=(place,)), light, readout)


def test_a_pad_s_place_asks_the_pairs_under_the_tip():
    dead, faded = pad_causes(keep_pairs=True)
    assert (dead.kind, dead.depth_mm, dead.lack) == ("deadband", (1.5, 2.5), "apart")
    assert (faded.kind, faded.depth_mm) == ("fade", (4.0, 5.0))
    names = {one.pair for one in dead.witnesses}
    assert {"E1-R4", "E3-R6", "E5-R8", "E7-R2"} <= names  # chords through the middle
    assert "E1-R8" not in names  # across a corner
    document = dead.to_json()
    assert document["lack"] == "apart"
    assert len(document["pairs"]) == len(dead.witnesses)


def test_a_place_without_a_pair_says_so():
    assert {cause.lack for cause in pad_causes(keep_pairs=False)} == {"none near"}


@pytest.mark.slow
@pytest.mark.parametrize("clear_mm", [10.0, 12.0])
def test_a_thick_pair_s_cause_is_seen_in_its_light(clear_mm):
    """The cause says what an independent look at the light of the middle pair shows."""
    design = PAIR.with_(**{"cavity.clear_thickness_mm": clear_mm})
    found = score(design, verdict_only=True)
    cause = next(one for one in found.causes if one.witnesses[0].pair == "E2-R2" and one.kind == "deadband")
    assert cause.lack == "apart"
    curves = found.pairs[0].curves
    inside = (curves.depth_mm > cause.depth_mm[0] + 0.1) & (curves.depth_mm < cause.depth_mm[1] - 0.6)
    assert (curves.direct[inside] > WHOLE * curves.direct[0]).all()
    mirrored = curves.top[inside] - curves.top[-1]
    assert (np.abs(mirrored) < 0.1 * np.ptp(curves.top)).all()
    assert cause.short_mm > 2.0


@pytest.mark.full
def test_a_thick_pair_s_cause_is_seen_by_the_ray_tracer():
    """At both ends of the deadband an independent ray tracer finds the direct light of the named pairs whole, and
    their mirrored light gone.
    """
    design = PAIR.with_(**{"cavity.clear_thickness_mm": 10.0})
    dead = next(one for one in score(design, verdict_only=True).causes if one.kind == "deadband")
    assert dead.lack == "apart"
    states = np.array([[*dead.place_mm, depth] for depth in (0.0, *dead.depth_mm)])
    tops = pressed_tops(design, states, by_symmetry=False)
    seen = trace_oracle(scene_of(design), states[:, :2], tops.near, fields=tops.fields, rays=800_000, seed=3)
    cavity, light = cavity_of(design), dict(zip(CLASSES, seen.flux, strict=True))
    names = [[one.name for one in parts] for parts in (cavity.emitters, cavity.receivers)]
    lacking = [one.pair.split("-") for one in dead.witnesses if one.lack == "apart"]
    rows = [[part.index(name) for part, name in zip(names, pair, strict=True)] for pair in lacking]
    emitters, receivers = np.array(rows).T
    straight = light["direct"][:, emitters, receivers].sum(axis=1)
    mirrored = (light["top"] + light["skirt"])[:, emitters, receivers].sum(axis=1)
    assert straight[0] > 0.0
    assert mirrored[0] > 0.0
    assert (straight[1:] > WHOLE * straight[0]).all()
    assert (mirrored[1:] < 0.15 * mirrored[0]).all()
