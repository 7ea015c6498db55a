"""Trials in processes of their own, so that a hang or a crash is a failure and not the end."""

from __future__ import annotations

import multiprocessing
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from tests.fuzz.trial import Outcome

HANG_S = 60.0
"""Of the clock: thirty times what an answer may take, for a machine with other work."""
Job = tuple[str, int, int]
"""Kind (design, file), seed, number."""


def outcomes_of(jobs: Sequence[Job], processes: int) -> list[Outcome]:
    """What came of the jobs, in their order."""
    numbers = count()
    found: dict[int, Outcome] = {}

    def follow() -> None:
        with _Worker() as worker:
            while (place := next(numbers)) < len(jobs):
                found[place] = worker.outcome(jobs[place])

    with ThreadPoolExecutor(processes) as pool:
        for one in [pool.submit(follow) for _ in range(processes)]:
            one.result()
    return [found[place] for place in range(len(jobs))]


class _Worker:
    """A process that is started anew when it hangs or dies."""

    def __enter__(self) -> _Worker:
        self._start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def outcome(self, job: Job) -> Outcome:
        """Ask the process, and wait no longer than HANG_S."""
        try:
            self._line.send(job)
            if self._line.poll(HANG_S):
                return self._line.recv()
            failure = f"no answer in {HANG_S:g} s"
        except (EOFError, OSError):
            self._process.join(10.0)
            failure = f"the process died with {self._process.exitcode}"
        self._stop()
        self._start()
        return Outcome(what=f"{job[0]} {job[2]}", failure=failure)

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._line: Connection
        self._line, other = context.Pipe()
        self._process: BaseProcess = context.Process(target=_answer, args=(other,), daemon=True)
        self._process.start()
        other.close()

    def _stop(self) -> None:
        self._line.close()
        self._process.kill()
        self._process.join()


def _answer(line: Connection) -> None:
    with tempfile.TemporaryDirectory(prefix="optopad-fuzz-") as made:
        folder = Path(made)
        while True:
            try:
                job = line.recv()
            except EOFError:
                return
            line.send(trial(job, folder))


def trial(job: Job, folder: Path) -> Outcome:
    """One job done here."""
    from tests.fuzz.designs import design_trial
    from tests.fuzz.files import file_trial

    kind, seed, number = job
    return (design_trial if kind == "design" else file_trial)(seed, number, folder)
