"""Whatever stands in a file, the answer is a result or a refusal that can be read, in seconds."""

from __future__ import annotations

import pytest

from tests.fuzz.__main__ import report
from tests.fuzz.bad_texts import bad_design
from tests.fuzz.trial import message_fault, tried
from tests.fuzz.workers import Job, outcomes_of, trial

SEED = 7


def jobs(designs: int, files: int) -> list[Job]:
    return [("design", SEED, number) for number in range(designs)] + [("file", SEED, n) for n in range(files)]


def require_readable(found) -> None:
    assert not any(one.failure for one in found), "\n".join(report(found, SEED))


def test_forty_designs_and_eight_files_are_answered(tmp_path):
    require_readable([trial(job, tmp_path) for job in jobs(40, 8)])


@pytest.mark.full
def test_two_thousand_designs_and_a_hundred_files_are_answered():
    require_readable(outcomes_of(jobs(2_000, 100), processes=2))


def test_a_seed_and_a_number_make_the_same_design():
    from random import Random

    assert bad_design(Random("design 1 5")) == bad_design(Random("design 1 5"))


def test_the_trial_itself_sees_what_is_wrong():
    def fails():
        raise OverflowError("int too large")

    assert "OverflowError" in tried("a", fails).failure
    assert "bytes" in tried("a", lambda: ["x" * 5_000]).failure
    assert "\\x1b" in message_fault("a\x1b[31m")


@pytest.mark.slow
def test_a_process_that_dies_is_a_failure_and_the_next_job_is_done(monkeypatch):
    found = outcomes_of([("design", SEED, "x" * 3), ("design", SEED, 1)], processes=1)  # no number: it breaks
    assert not found[1].failure
