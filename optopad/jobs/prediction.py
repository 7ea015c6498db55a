"""The predict verb's work: how well presses on a design will be told, before it is built.

design + protocol ──► light at its places (once) ──► signal chain, a draw a seed ──► data
training sets ──► learners ──► models ──► test sets ──► tables, pictures, page; the bound beside them
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from design.errors import InputError
from design.progress import OnStep
from design.protocols.press import PressProtocol, load_protocol_file
from design.rules.check import require_valid
from design.shape.cavity import workspace_of
from design.spec import SensorDesign
from fabrication.bundle import bundle, bundle_name
from optopad.jobs.accuracy_files import write_accuracy
from optopad.jobs.evaluation import accuracies
from optopad.results.accuracy import Accuracy, ModelAccuracy, accuracy_of
from optopad.work.prediction_cost import QUICK_PROTOCOL, STEM
from sims.evaluation.chain_bounds import bounds_by_depth
from sims.evaluation.published import published_touch
from sims.evaluation.tables import ERROR_DEPTHS_MM
from sims.learning.inference.model_file import save_model
from sims.learning.inference.signal_map.signal_map_model import KIND as SIGNAL_MAP
from sims.learning.inference.touch_model import TouchModel
from sims.learning.learners import LEARNERS, Learner
from sims.learning.samples.settings import EFFORTS
from sims.learning.signal_map.map_learner import chain_noise, signal_map_learner
from sims.readings.chain import chain_of
from sims.readings.press_data import clipped_note
from sims.readings.protocol import ProtocolCurves, draw, protocol_curves

MOST_DRAWS = 50


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How thorough a prediction is.

    Attributes
    ----------
    protocol : name of the packaged protocol
    fit : name of the fits' settings
    is_coarse : two thirds of the knots in depth
    learners : by default
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


def predict(
    design: SensorDesign,
    out: Path,
    *,
    effort: Effort,
    learners: Sequence[str] = (),
    protocol: str | None = None,
    draws: int = 1,
    seed: int = 0,
    on_step: OnStep,
) -> tuple[Accuracy, Path]:
    """Simulate a protocol, train on it, judge; tables, page, pictures and models into the bundle.

    Parameters
    ----------
    learners : by name; empty takes those of the effort
    protocol : packaged name or file; None takes that of the effort
    draws : how often the chain is drawn and everything trained anew; tables pool them
    seed : of the light and of the first draw

    Raises
    ------
    DesignError, InputError, ModelScopeError : the design, a name, or presses outside the models' scope.
    """
    require_valid(design)
    chosen = _known(learners or effort.learners)
    if not 1 <= draws <= MOST_DRAWS:
        raise InputError(f"--draws: {draws} is refused: give 1 to {MOST_DRAWS}")
    wanted = load_protocol_file(protocol or effort.protocol)
    how = wanted.fitted_to(design)
    _require_roles(how)
    curves = protocol_curves(design, how, seed=seed, is_coarse=effort.is_coarse, on_step=on_step)
    with_map = LEARNERS | {SIGNAL_MAP: signal_map_learner(design, quick=effort.is_coarse, seed=seed)}
    fits = {name: with_map[name] for name in chosen}
    judged: dict[tuple[str, str], list[ModelAccuracy]] = {}
    models: dict[str, TouchModel] = {}
    for number in range(draws):
        of_draw = _draw_judged(curves, fits, effort, seed + number, on_step)
        models = models or {name: model for name, (model, _) in of_draw.items()}
        for name, (_, tables) in of_draw.items():
            for one in tables:
                judged.setdefault((name, one.test_set), []).append(one)
    found = Accuracy(
        name=design.name,
        digest=design.digest,
        found=tuple(_pooled(parts) for parts in judged.values()),
        published=published_touch(design),
        notes=(*_cut(wanted, how, design), *_notes(how, effort, draws, curves, seed)),
        settings=_settings(how, effort, draws, seed, models),
        bound_mm={} if effort.is_coarse else bound_mm(design, curves, seed, on_step),
    )
    with bundle(design, out, seed=seed) as folder:
        write_accuracy(found, workspace_of(design), folder / "sims", STEM)
        for name, model in models.items():
            (folder / "sims" / "models").mkdir(exist_ok=True)
            save_model(folder / "sims" / "models" / f"{name}.optomodel", model)
    return found, out / bundle_name(design)


def bound_mm(
    design: SensorDesign, curves: ProtocolCurves, seed: int, on_step: OnStep
) -> dict[float, tuple[float, float]]:
    """The Cramér-Rao bounds under the chain at the depths of the tables that the design reaches."""
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
    """Refuse, before any light is traced, a protocol that nothing can be trained or judged on."""
    for role, verb in (("train", "trained"), ("test", "judged")):
        if not any(one.role == role for one in protocol.sets):
            raise InputError(
                f"protocol {protocol.name}: has no set of role {role!r}, so nothing can be {verb}; add one"
            )


def _cut(wanted: PressProtocol, how: PressProtocol, design: SensorDesign) -> tuple[str, ...]:
    if how.deepest_mm == wanted.deepest_mm:
        return ()
    return (
        f"protocol {wanted.name} presses to {wanted.deepest_mm:g} mm, the design is for "
        f"{design.operating.max_depth_mm:g} mm: depths beyond {how.deepest_mm:g} mm were left out",
    )


def _known(names: Sequence[str]) -> tuple[str, ...]:
    """Names of learners, each once; `all` stands for all."""
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
    """Every learner trained and judged on one draw of the chain."""
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


def _pooled(parts: Sequence[ModelAccuracy]) -> ModelAccuracy:
    first = parts[0]
    return accuracy_of(first.learner, first.test_set, first.is_ambient, [one.presses for one in parts])


def _notes(
    protocol: PressProtocol, effort: Effort, draws: int, curves: ProtocolCurves, seed: int
) -> tuple[str, ...]:
    notes = [
        f"simulated: protocol {protocol.name}, {draws} draw{'s' if draws > 1 else ''} of the signal chain with the "
        f"design's noise, models of the settings {effort.fit!r} trained on the training sets of each draw alone",
        "light of the test presses is traced like that of the training presses: what the light model leaves out "
        "(docs/understand/model.md) is not in these errors",
        "truth is what the stage reports, as on a bench: errors of its zero and place are part of the errors",
    ]
    if published_touch(curves.design) is not None:
        notes.append(
            "how near the published touch table is depends on the scale of the readings before the linear classifier, "
            "which was not published (docs/validation/reality.md)"
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
