"""Seconds of every test of a run, kept as a file; `python -m tests.durations FILE ...` prints the costliest files."""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

SHOWN = 20


def write_durations(file: Path, reports: Iterable[Any]) -> None:
    """Write one line a phase of a test: seconds, phase, test; the longest first."""
    phases = [(one.duration, one.when, one.nodeid) for one in reports if hasattr(one, "duration")]
    file.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"{seconds:.3f} {when} {test}\n" for seconds, when, test in sorted(phases, reverse=True)]
    file.write_text("".join(lines), encoding="utf-8")


def table(file: Path) -> str:
    """The costliest test files of a run, with their seconds, their tests and the longest of these."""
    seconds: dict[str, float] = defaultdict(float)
    longest: dict[str, tuple[float, str]] = {}
    tests: dict[str, set[str]] = defaultdict(set)
    for line in file.read_text(encoding="utf-8").splitlines():
        one, _, test = line.split(" ", 2)
        name, _, function = test.partition("::")
        seconds[name] += float(one)
        longest.setdefault(name, (float(one), function))
        tests[name].add(function)
    rows = sorted(seconds, key=lambda name: -seconds[name])
    count, total = sum(map(len, tests.values())), sum(seconds.values())
    heading = f"{file}: {count} tests in {len(rows)} files, {total:.0f} s summed over workers"
    lines = [
        f"{seconds[name]:7.1f} s {len(tests[name]):5} tests  {name}  ({longest[name][0]:.1f} s {longest[name][1]})"
        for name in rows[:SHOWN]
    ]
    return "\n".join([heading, *lines])


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        print(table(Path(argument)))
