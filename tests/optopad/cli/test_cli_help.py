"""What `optopad` alone says of itself: its version, and its verbs in groups on a narrow screen."""

from __future__ import annotations

from importlib.metadata import version

import pytest

from optopad.cli import main

WIDTH = 80
GROUPS = ("Main job:", "Design:", "Mold:", "Physics:", "Search:", "Built sensor:")


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"optopad {version('optopad')}\n"


@pytest.mark.parametrize("arguments", [["--help"], ["-h"]])
def test_the_help_has_all_verbs_in_groups_and_cuts_no_line(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if len(line) > WIDTH] == []
    assert [line for line in lines[1:] if "..." in line] == []  # the first line has the arguments' own
    assert [line for line in lines if line in GROUPS] == list(GROUPS)
    last = lines[lines.index(GROUPS[0]) :]
    told = [line.split()[0] for line in last if line.startswith("  ")]
    assert len(told) == len(set(told))
    assert {"run", "check", "build", "score", "improve", "driver"} <= set(told)
    assert all(line.endswith(".") for line in last if line.startswith("  "))
