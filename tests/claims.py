"""What tests claim, by name: `python -m tests.claims REVISION` lists test functions that were there and are gone."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]


def claims_in(source: str) -> Iterator[str]:
    """Names of the test functions in a file."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            yield node.name


def claims_of(revision: str) -> set[tuple[str, str]]:
    """(name, file) of every test function of a revision."""
    listed = git("ls-tree", "-r", "--name-only", revision, "tests").splitlines()
    files = [name for name in listed if Path(name).name.startswith("test_") and name.endswith(".py")]
    return {(claim, file) for file in files for claim in claims_in(git("show", f"{revision}:{file}"))}


def git(*arguments: str) -> str:
    """What git prints."""
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True).stdout


def main(revision: str) -> None:
    """Print the two counts, and each name that is gone, with the file that it was in."""
    before, now = claims_of(revision), claims_of("HEAD")
    print(f"{len(before)} test functions in {revision}, {len(now)} now")
    names = {name for name, _ in now}
    for name, file in sorted(before - now, key=lambda claim: claim[1]):
        if name not in names:
            print(f"gone  {file}::{name}")


if __name__ == "__main__":
    main(sys.argv[1])
