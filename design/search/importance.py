"""Importance of each field for an objective, by the method PED-ANOVA (Watanabe et al., IJCAI 2023).

For each field, the method compares the distribution of its values in the best tenth of the designs with that in all
designs. Designs whose judgement stopped early are excluded. Interactions between fields are not separated.
"""

from __future__ import annotations

import warnings

import optuna
from optuna.importance import PedAnovaImportanceEvaluator
from optuna.trial import FrozenTrial, TrialState

from optopad.design.search.explore import opened_study, trials_in
from optopad.design.search.space import SearchSpace

LEAST_DESIGNS = 20
"""Least number of designs: with fewer, the best tenth means nothing."""


def importances(space: SearchSpace, url: str) -> dict[str, dict[str, float]]:
    """Importance of each field as {objective: {path: share}}; the shares of an objective sum to 1.

    Empty if fewer than `LEAST_DESIGNS` designs were judged completely.
    """
    with opened_study(space, url) as study:
        if len(trials_in(study, TrialState.COMPLETE)) < LEAST_DESIGNS:
            return {}
        paths = [field.path for field in space.fields]
        return {
            objective.figure: _shares(study, paths, number)
            for number, objective in enumerate(space.objectives)
        }


def _shares(study: optuna.Study, paths: list[str], number: int) -> dict[str, float]:
    """Shares of an objective; the fields are named, because Optuna's own order changes with Python's hash seed."""
    sign = -1.0 if study.directions[number] == optuna.study.StudyDirection.MAXIMIZE else 1.0

    def loss(trial: FrozenTrial) -> float:
        return sign * float(trial.values[number])

    with warnings.catch_warnings():
        # Optuna warns about the sign, which `loss` handles, and about few designs, which the report mentions.
        for known in ("PedAnovaImportanceEvaluator computes", "Target and region quantiles"):
            warnings.filterwarnings("ignore", message=known, category=UserWarning)
        evaluator = PedAnovaImportanceEvaluator()
        found = optuna.importance.get_param_importances(study, evaluator=evaluator, params=paths, target=loss)
    return {name: float(share) for name, share in found.items()}
