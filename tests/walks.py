"""How often a design walks from room to room during a command.

    python -m tests.walks [NAME of a preset]

A design enters a file when a function of this file gets it as an argument, and the caller is in another file. An entry
into a file that it has entered before is a return. A returning design is asked again for what is known already.

A look-up of a result that `optopad.design.once` keeps counts separately. Calls by the design's own methods do not
count, nor do those between functions of one file. Each call of a generator counts once. Only the design of the command
counts, not the variants that the command makes.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from types import FrameType
from typing import Any

from optopad.design.once import once
from optopad.design.spec import SensorDesign

ROOT = str(Path(__file__).parents[1])
KEPT = once.__code__.co_filename
GENERATOR = 0x20


class Walks:
    """Counts the entries of a design into each file, by name of the file."""

    def __init__(self) -> None:
        self.entries: Counter[str] = Counter()
        self.lookups = 0
        self.design: SensorDesign | None = None
        self._first: dict[object, int] = {}

    def __call__(self, frame: FrameType, event: str, _: Any) -> None:
        """Take note of one event of `sys.setprofile`."""
        code, caller = frame.f_code, frame.f_back
        if event != "call" or caller is None or caller.f_code.co_filename == code.co_filename:
            return
        if not (code.co_filename.startswith(ROOT) and caller.f_code.co_filename.startswith(ROOT)):
            return
        if code.co_flags & GENERATOR and frame.f_lasti > self._first.setdefault(code, frame.f_lasti):
            return  # resumed
        names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        given = [frame.f_locals.get(name) for name in names if name != "self"]
        if self.design is None:
            self.design = next((one for one in given if isinstance(one, SensorDesign)), None)
        if self.design is None or not any(one is self.design for one in given):
            return
        if code.co_filename == KEPT:
            self.lookups += 1
        else:
            self.entries[Path(code.co_filename).relative_to(ROOT).as_posix()] += 1

    def of(self, command: Callable[[], object]) -> Walks:
        """These walks, with those of a command."""
        sys.setprofile(self)
        try:
            command()
        finally:
            sys.setprofile(None)
        return self

    def __str__(self) -> str:
        rooms, entries = len(self.entries), sum(self.entries.values())
        most = ", ".join(f"{name} {count - 1}" for name, count in self.entries.most_common(6) if count > 1)
        return f"{rooms} stays, {entries - rooms} returns ({most}), {self.lookups} look-ups"


def main() -> None:
    """Print stays and returns for the commands check, score and build."""
    from optopad.cli.main import main as optopad

    name = sys.argv[1] if len(sys.argv) > 1 else "piacenza2017-pair"
    with tempfile.TemporaryDirectory() as out:
        for command in ("check", "score", "build"):
            where = [] if command == "check" else ["--out", out]
            words = [command, name, *where, "--json"]
            with redirect_stdout(None):
                walks = Walks().of(lambda words=words: optopad(words))
            print(f"{command:6}", walks)


if __name__ == "__main__":
    main()
