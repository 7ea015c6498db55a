"""Predicts a design's errors of touch, location and depth, before it is manufactured.

design + protocol ──► light at the protocol's locations (once) ──► signal chain, one draw per seed ──► data
training sets ──► learners ──► models ──► test sets ──► tables, pictures, page, Cramér-Rao bound

The results are files: JSON, a page, and its pictures as SVG and PNG.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from optopad.cli.verb import Asked, typed, verb
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.press_protocol import QUICK_PROTOCOL, PressProtocol, load_protocol_file
from optopad.design.progress import OnStep, silent
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import workspace_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.screen.prediction import ModelAccuracy, PredictedAccuracy, Prediction, accuracy_of
from optopad.sims.learning.after_release import FoundAgain, found_again
from optopad.sims.learning.chain_bounds import bounds_by_depth
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.learning.inference.signal_map import KIND as SIGNAL_MAP
from optopad.sims.learning.inference.touch_model import TouchModel
from optopad.sims.learning.learners import EFFORTS, LEARNERS, Learner
from optopad.sims.learning.map_learner import chain_noise, signal_map_learner
from optopad.sims.learning.tables import ERROR_DEPTHS_MM, published_touch
from optopad.sims.readings.press_data import clipped_note
from optopad.sims.readings.protocol import ProtocolCurves, draw, protocol_curves
from optopad.sims.readings.signal_chain import chain_of
from optopad.sims.two_touch_errors import LEAST_MM, predicted_errors, require_deep, require_touches
from optopad.verbs.evaluate import accuracies, write_accuracy
from optopad.work import OUT

MOST_DRAWS = 50
TWO_TOUCHES = (
    f"two touches are at random places, directions and depths of {LEAST_MM:g} mm or more, with the noise and drift of "
    "the test sets; the true places are those of the tips"
)


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Settings that decide how thorough and how slow a prediction is.

    Attributes
    ----------
    protocol : name of the packaged protocol
    fit : name of the settings for training
    is_coarse : whether to trace light at only two thirds of the usual depths
    learners : default learners
    """

    protocol: str
    fit: str
    is_coarse: bool
    learners: tuple[str, ...]


QUICK = Effort(protocol=QUICK_PROTOCOL, fit="quick", is_coarse=True, learners=("kernel-ridge",))
USUAL = Effort(
    protocol="piacenza2017", fit="default", is_coarse=False, learners=("kernel-ridge", "extra-trees")
)
FULL = replace(USUAL, fit="full")


@verb(
    learners=typed("NAME", flag="--learner"),
    quick=typed(default=False),
    protocol=typed("NAME"),
    draws=typed("N"),
    touches=typed("N"),
    set_before="out",
)
def predict(
    design: SensorDesign,
    *,
    learners: Sequence[str] = (),
    quick: bool = True,
    full: bool = False,
    protocol: str | None = None,
    draws: int = 1,
    touches: int = 1,
    out: str | PathLike[str] = OUT,
    seed: int = 0,
    on_step: OnStep | None = None,
    asked: Asked | None = None,
) -> Prediction:
    """Predict the errors of touch, location and depth: simulate a data collection, train models, evaluate them.

    Tables, page, pictures and models are written into the bundle. A first look (`quick`, the default in Python) takes
    less than a minute, the whole collection minutes.

    Parameters
    ----------
    learners : kernel-ridge (the paper's), extra-trees, signal-map, or all.
    quick : A thinned protocol, for a first look.
    full : 24,000 samples in the kernel.
    protocol : Packaged protocol or a file (.toml).
    draws : Draws of noise, drift and offsets.
    touches : 2: also how often a signal map finds a second touch, and the errors by distance.

    Raises
    ------
    DesignError, InputError, ModelScopeError : the design or a name is invalid, or presses are outside the models'
        scope.
    """
    if asked is not None and quick and full:
        raise InputError("predict: --quick and --full contradict each other; give one of them")
    effort, step = FULL if full else QUICK if quick else USUAL, on_step or silent
    require_valid(design)
    require_touches(touches, Draft.of(design))
    if touches > 1:
        require_deep(Draft.of(design))
    chosen = _known(learners or effort.learners)
    if touches > 1 and SIGNAL_MAP not in chosen:
        chosen = (*chosen, SIGNAL_MAP)
    if not 1 <= draws <= MOST_DRAWS:
        raise InputError(f"--draws: {draws} is refused: give 1 to {MOST_DRAWS}")
    wanted = load_protocol_file(protocol or effort.protocol)
    how = wanted.fitted_to(design)
    _require_roles(how)
    curves = protocol_curves(design, how, seed=seed, is_coarse=effort.is_coarse, on_step=step)
    with_map = LEARNERS | {
        SIGNAL_MAP: signal_map_learner(design, quick=effort.is_coarse, seed=seed, touches=touches)
    }
    fits = {name: with_map[name] for name in chosen}
    judged: dict[tuple[str, str], list[ModelAccuracy]] = {}
    models: dict[str, TouchModel] = {}
    for number in range(draws):
        of_draw = _draw_judged(curves, fits, effort, seed + number, step)
        models = models or {name: model for name, (model, _) in of_draw.items()}
        for name, (_, tables) in of_draw.items():
            for one in tables:
                judged.setdefault((name, one.test_set), []).append(one)
    again = _found_again(curves, models, seed, step)
    of_two = (
        (
            predicted_errors(
                SIGNAL_MAP, models[SIGNAL_MAP], curves, quick=effort.is_coarse, seed=seed, on_step=step
            ),
        )
        if touches > 1
        else ()
    )
    found = PredictedAccuracy(
        name=design.name,
        digest=design.digest,
        found=tuple(_pooled(parts) for parts in judged.values()),
        published=published_touch(design),
        notes=(
            *map(str, again),
            *_cut(wanted, how, design),
            *_notes(how, effort, draws, curves, seed),
            *([TWO_TOUCHES] if of_two else []),
        ),
        settings=_settings(how, effort, draws, seed, models),
        bound_mm={} if effort.is_coarse else bound_mm(design, curves, seed, step),
        found_again=again,
        touches=of_two,
    )
    with bundle(design, Path(out), seed=seed) as folder:
        write_accuracy(found, workspace_of(design), folder / "sims", "prediction")
        for name, model in models.items():
            (folder / "sims" / "models").mkdir(exist_ok=True)
            save_model(folder / "sims" / "models" / f"{name}.optomodel", model)
    return Prediction(design=design, found=found, folder=Path(out) / bundle_name(design))


def bound_mm(
    design: SensorDesign, curves: ProtocolCurves, seed: int, on_step: OnStep
) -> dict[float, tuple[float, float]]:
    """Cramér-Rao bounds by depth: standard deviations of location and of depth [mm].

    The depths are those of the error tables, down to the design's deepest press.
    """
    chain = chain_of(design, curves.readout)
    noise = replace(
        chain_noise(design, len(chain.gains), chain.gains.size),
        clip_counts=np.full(chain.gains.size, chain.full_scale_counts),
    )
    deepest = design.operating.max_depth_mm
    return bounds_by_depth(
        design,
        chain.gains,
        noise,
        [depth for depth in ERROR_DEPTHS_MM if 0.0 < depth <= deepest],
        seed=seed,
        on_step=lambda share: on_step("bounds", share),
    )


def _require_roles(protocol: PressProtocol) -> None:
    for role, done in (("train", "trained"), ("test", "judged")):
        if not any(one.role == role for one in protocol.sets):
            raise InputError(
                f"protocol {protocol.name}: has no set of role {role!r}, so nothing can be {done}; add one"
            )


def _cut(wanted: PressProtocol, how: PressProtocol, design: SensorDesign) -> tuple[str, ...]:
    if how.deepest_mm == wanted.deepest_mm:
        return ()
    return (
        f"protocol {wanted.name} presses to {wanted.deepest_mm:g} mm, the design is for "
        f"{design.operating.max_depth_mm:g} mm: depths beyond {how.deepest_mm:g} mm were left out",
    )


def _known(names: Sequence[str]) -> tuple[str, ...]:
    known = (*LEARNERS, SIGNAL_MAP)
    wanted = known if "all" in names else tuple(dict.fromkeys(names))
    for name in wanted:
        if name not in known:
            raise InputError(f"--learner: {name!r} is no learner; give {', '.join(known)} or all")
    return wanted


def _draw_judged(
    curves: ProtocolCurves,
    learners: Mapping[str, Learner],
    effort: Effort,
    seed: int,
    on_step: OnStep,
) -> dict[str, tuple[TouchModel, list[ModelAccuracy]]]:
    data = draw(curves, seed=seed, on_step=on_step)
    train, test = data.role("train"), data.role("test")
    found = {}
    for name, fit in learners.items():
        model = fit(
            train,
            seed=seed,
            on_step=lambda stage, share, name=name: on_step(f"{name}: {stage}", share),  # type: ignore[misc]
            settings=EFFORTS[effort.fit],
        )
        found[name] = (model, accuracies(model, test, workspace_of(curves.design), on_step=on_step))
    return found


def _found_again(
    curves: ProtocolCurves, models: Mapping[str, TouchModel], seed: int, on_step: OnStep
) -> tuple[FoundAgain, ...]:
    """When each model finds a touch again after a release; empty for a pad without memory."""
    if curves.design.noise.release_residue == 0.0:
        return ()
    found: list[FoundAgain] = []
    for name, model in models.items():
        on_step("memory", len(found) / len(models))
        found.append(found_again(curves, model, learner=name, seed=seed))
    return tuple(found)


def _pooled(parts: Sequence[ModelAccuracy]) -> ModelAccuracy:
    first = parts[0]
    return accuracy_of(first.learner, first.test_set, first.is_ambient, [one.presses for one in parts])


def _notes(
    protocol: PressProtocol, effort: Effort, draws: int, curves: ProtocolCurves, seed: int
) -> tuple[str, ...]:
    notes = [
        f"simulated: protocol {protocol.name}, {draws} draw{'s' if draws > 1 else ''} of the signal chain with the "
        f"design's noise, models of the settings {effort.fit!r} trained on the training sets of each draw alone",
        "test and training presses are traced by the same light model: the limits of that model "
        "(docs/understand/model.md) are not in these errors",
        "the true press is the one that the stage reports, as on a bench: errors of its zero and position are included",
    ]
    if published_touch(curves.design) is not None:
        notes.append(
            "the agreement with the published touch table depends on the scale of the readings before the linear "
            "classifier, which was not published (docs/validation/reality.md)"
        )
    clipped = clipped_note(draw(curves, seed=seed).role("test"))
    return (*notes, clipped) if clipped is not None else tuple(notes)


def _settings(
    protocol: PressProtocol, effort: Effort, draws: int, seed: int, models: Mapping[str, TouchModel]
) -> dict[str, Any]:
    return {
        "seed": seed,
        "draws": draws,
        "protocol": protocol.name,
        "effort": effort.fit,
        "fits": {name: dict(model.header.settings) for name, model in models.items()},
    }
