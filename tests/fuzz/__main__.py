"""A long fuzz from the command line: `python -m tests.fuzz --designs 17000 --files 450 --seed 1`.

`--only "design 1234"` repeats one trial of a seed and keeps its file.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from tests.fuzz.trial import Outcome
from tests.fuzz.workers import Job, outcomes_of, trial


def main() -> int:
    """Try them, print what failed and the figures; 1 if anything failed."""
    asked = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    asked.add_argument("--designs", type=int, default=17_000)
    asked.add_argument("--files", type=int, default=450)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--only", metavar="TRIAL")
    asked.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    given = asked.parse_args()
    if given.only:
        kind, number = given.only.split()
        folder = Path(tempfile.mkdtemp(prefix="optopad-fuzz-"))
        found = [trial((kind, given.seed, int(number)), folder)]
        print(f"files in {folder}")
    else:
        jobs: list[Job] = [("design", given.seed, number) for number in range(given.designs)]
        jobs += [("file", given.seed, number) for number in range(given.files)]
        found = outcomes_of(jobs, given.processes)
    print("\n".join(report(found, given.seed)))
    return int(any(one.failure for one in found))


def report(found: list[Outcome], seed: int) -> list[str]:
    """Failures with how to repeat each, and the figures."""
    lines = [
        f'{one.what}: {one.failure}\n  again: python -m tests.fuzz --seed {seed} --only "{one.what}"'
        for one in found
        if one.failure
    ]
    slowest = max(found, key=lambda one: one.seconds)
    longest = max(found, key=lambda one: one.message_bytes)
    return [
        *lines,
        f"{len(found)} trials, {sum(one.is_refused for one in found)} refused, {len(lines)} failed",
        f"longest answer {slowest.seconds:.2f} s ({slowest.what}), longest message {longest.message_bytes} bytes "
        f"({longest.what})",
    ]


if __name__ == "__main__":
    sys.exit(main())
