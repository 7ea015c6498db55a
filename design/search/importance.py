"""Which field moved an objective: PED-ANOVA (Watanabe et al., IJCAI 2023) over the designs judged to the end.

It compares where the best tenth of these lies with where all of them lie, field by field. Designs that were stopped
early are not in it, and interactions between fields are not told apart.
"""

from __future__ import annotations

import warnings

import optuna
from optuna.importance import PedAnovaImportanceEvaluator
from optuna.trial import FrozenTrial, TrialState

from design.search.explore import opened_study, trials_in
from design.search.space import SearchSpace

LEAST_DESIGNS = 20
"""Fewer say nothing about a tenth of them."""


def importances(space: SearchSpace, url: str) -> dict[str, dict[str, float]]:
    """Share of each field, summing to 1, by objective; empty when too few designs were judged to the end."""
    with opened_study(space, url) as study:
        if len(trials_in(study, TrialState.COMPLETE)) < LEAST_DESIGNS:
            return {}
        return {objective.figure: _shares(study, number) for number, objective in enumerate(space.objectives)}


def _shares(study: optuna.Study, number: int) -> dict[str, float]:
    sign = -1.0 if study.directions[number] == optuna.study.StudyDirection.MAXIMIZE else 1.0

    def loss(trial: FrozenTrial) -> float:
        return sign * float(trial.values[number])

    with warnings.catch_warnings():
        # It reminds of the sign, which `loss` sees to, and of few designs, which the page counts.
        for known in ("PedAnovaImportanceEvaluator computes", "Target and region quantiles"):
            warnings.filterwarnings("ignore", message=known, category=UserWarning)
        evaluator = PedAnovaImportanceEvaluator()
        found = optuna.importance.get_param_importances(study, evaluator=evaluator, target=loss)
    return {name: float(share) for name, share in found.items()}
