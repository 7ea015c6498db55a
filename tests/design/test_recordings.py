"""Recordings: what a set of presses may say, and the one place that subtracts the dark state."""

import numpy as np
import pytest

from optopad.design.errors import InputError
from optopad.design.recordings import UNNAMED, SetEntry, sets_json, signals_of
from tests.said import pattern


@pytest.mark.parametrize("kind", [np.int32, np.float32, np.float64])
def test_signals_are_the_lit_readings_less_those_of_the_last_state_in_the_same_type(kind: type) -> None:
    counts = np.array([[[5, 9], [7, 3], [6, 4]]], dtype=kind)
    signals = signals_of(counts)
    assert signals.dtype == kind
    assert signals.tolist() == [[[-1, 5], [1, -1]]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"role": "exam"}, "'a': role ... 'exam'"),
        ({"pattern": "spiral"}, "'a': pattern ... 'spiral'"),
        ({"is_ambient": 1}, "set 'a': is_ambient is 1, needs true or false"),
    ],
)
def test_a_set_that_says_something_unknown_is_refused(changes: dict[str, object], message: str) -> None:
    fields = {"name": "a", "role": "train", "pattern": "grid", "is_ambient": True}
    with pytest.raises(InputError, match=pattern(message)):
        SetEntry(**(fields | changes))  # type: ignore[arg-type]


def test_sets_are_written_as_files_have_them() -> None:
    assert sets_json([UNNAMED]) == (
        '[{"name": "unnamed", "role": "train", "pattern": "unknown", "is_ambient": true}]'
    )
