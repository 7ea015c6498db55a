"""The header of a model that was just trained."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from sims.learning.inference.header import ModelHeader
from sims.learning.samples.training_data import TrainingData

LIBRARIES = ("optopad", "numpy", "scipy", "scikit-learn")
SIGMA_OF_STAGE = "what the stage says, its errors included"
SIGMA_OF_TIP = "where the tip is, without the stage's errors"
"""What a model's `sigma_mm` is a deviation of, for its header: learners know the tip by the stage's word only."""


def trained_header(kind: str, data: TrainingData, settings: Mapping[str, Any], seed: int) -> ModelHeader:
    """What the data were and what the fit chose; the force curve is added where the design is at hand."""
    source = data.source
    return ModelHeader(
        kind=kind,
        design_digest=source.design_digest,
        emitter_names=source.emitter_names,
        receiver_names=source.receiver_names,
        untouched_counts=data.untouched_counts,
        trained_on=data.facts(),
        settings={**settings, "seed": seed, "sigma_of": SIGMA_OF_STAGE},
        created_with={name: version(name) for name in LIBRARIES} | {"python": platform.python_version()},
    )
