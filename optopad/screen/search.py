"""The result of a search for better designs, and its progress on standard error."""

from __future__ import annotations

import csv
import io
import json
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.design.search.explore import Findings, OnTried
from optopad.design.search.figures import FIGURES
from optopad.design.search.improve import Judged, Tried
from optopad.design.spec import SensorDesign
from optopad.screen.answer import INTERRUPTED, Result
from optopad.screen.comparison import MOST_DESIGNS
from optopad.screen.figures import figures_of, in_columns
from optopad.sims.score.result import headline
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD

LINE_EVERY_S = 30.0
"""Without a terminal, a progress line is printed when the Pareto front changes, or after this time [s]."""
QUICK_ERRORS = {"draft": 3.0, "search": 2.0, "score": 0.0}
"""Assumed error of a margin in a search [noise standard deviations], by setting of the light model.

The values round up the largest observed errors: 1.94 for `search` on 13 pads (docs/how-to/search-layouts.md), 2.9 for
`draft` on four pads of 4 + 4 parts. Other pads may have larger ones.
"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Search(Result):
    """The result of a search for better designs.

    Attributes
    ----------
    folder : folder with tables, design files and page
    findings : designs and figures that the search found
    files : design file of each design on the Pareto front, relative to the folder
    importance : for each objective, each field's share of the objective's variation [-]; empty if the search evaluated
        too few designs
    """

    folder: Path
    findings: Findings
    files: tuple[str, ...]
    importance: dict[str, dict[str, float]]

    @property
    def base_headline(self) -> str:
        """The base design's verdict in the words of `optopad score`."""
        return self._headline(self.findings.base, self.findings.space.base)

    def headline(self, one: Tried) -> str:
        """A design's verdict in the words of `optopad score`; empty if the design has no verdict.

        The verdict is undecided if the error of the search's light model may change it.
        """
        design = self.findings.space.design_at(one.parameters) if one.judged.verdict else None
        return self._headline(one.judged, design)

    def is_open(self, judged: Judged) -> bool:
        """Whether a design's verdict is undecided, because the error of the search's light model may change it."""
        margin = judged.figures.get("margin")
        error = QUICK_ERRORS[self.findings.space.accuracy]
        return margin is not None and abs(margin - DEADBAND_THRESHOLD) < error

    def _headline(self, judged: Judged, design: SensorDesign | None) -> str:
        if design is None or not judged.verdict:
            return ""
        return headline(
            judged.verdict,
            is_open=self.is_open(judged),
            usable_mm=judged.figures.get("usable_depth_mm"),
            asked_mm=design.operating.max_depth_mm,
            is_short=True,
        )

    @property
    def exit_code(self) -> int:
        """Exit code of the command."""
        return INTERRUPTED if self.findings.is_interrupted else 0

    def lines(self) -> list[str]:
        """The front as text: figures of the search, verdicts, sizes and price."""
        found = self.findings
        stopped = sum(bool(one.judged.reason) for one in found.tried)
        lines = [
            f"search    {found.space.name}: {len(found.tried)} of {max(found.wanted, len(found.tried))} designs "
            f"judged, {stopped} stopped early",
            *(f"limit     {limit}" for limit in found.limits),
            *self._front(),
        ]
        if not found.front:
            lines.append(
                "front     empty: no design was judged to the end within all limits; designs.csv lists the reasons"
            )
        return lines

    def screen(self) -> list[str]:
        """The front, its files, and the next command."""
        lines = [*self.lines(), f"files     {self.folder}", f"report    {self.folder / 'report.html'}"]
        if self.findings.front:
            lines.append(
                f"next      {self._scoring()}   (the figures of a score; those above have search accuracy)"
            )
        return lines

    def _front(self) -> list[str]:
        """Lines of a table of the base design and the front."""
        found = self.findings
        names = [objective.figure for objective in found.space.objectives]
        if "usable_depth_mm" in found.base.figures and "usable_depth_mm" not in names:
            names.append("usable_depth_mm")
        designs = [found.space.base, *(found.space.design_at(one.parameters) for one in found.front)]
        judged = [found.base, *(one.judged for one in found.front)]
        verdicts = [self.base_headline, *map(self.headline, found.front)]
        columns = [("design", "", ["base", *self.files]), ("verdict", "", verdicts)]
        for name in names:
            values = [one.figures.get(name) for one in judged]
            columns.append((name, "", ["-" if value is None else f"{value:.4g}" for value in values]))
        for cells in zip(*(figures_of(design, None).of_size for design in designs), strict=True):
            columns.append((cells[0].name, cells[0].unit, [cell.text for cell in cells]))
        return in_columns(columns)

    def _scoring(self) -> str:
        """Command that scores the designs of the front, or the first of them if they are too many to compare."""
        if len(self.files) == 1:
            return f"optopad score {self.folder / self.files[0]}"
        if len(self.files) <= MOST_DESIGNS:
            return f"optopad compare {self.folder / 'designs'}/*.toml"
        return f"optopad compare {' '.join(str(self.folder / file) for file in self.files[:3])}"

    def to_json(self) -> dict[str, Any]:
        """The search as plain data for JSON."""
        found = self.findings
        return {
            "name": found.space.name,
            "digest": found.space.digest,
            "folder": str(self.folder),
            "report": str(self.folder / "report.html"),
            "sampler": found.space.search.sampler,
            "seed": found.space.search.seed,
            "accuracy": found.space.accuracy,
            "designs": len(found.tried),
            "wanted": found.wanted,
            "stopped_early": sum(bool(one.judged.reason) for one in found.tried),
            "feasible": sum(one.is_feasible for one in found.tried),
            "interrupted": found.is_interrupted,
            "limits": [str(limit) for limit in found.limits],
            "base": {
                "digest": found.space.base.digest,
                "figures": found.base.figures,
                "verdict": found.base.verdict,
                "headline": self.base_headline,
            },
            "front": [
                {
                    "number": one.number,
                    "digest": one.digest,
                    "file": file,
                    "parameters": {name: plain(value) for name, value in one.parameters.items()},
                    "figures": one.judged.figures,
                    "verdict": one.judged.verdict,
                    "headline": self.headline(one),
                    "is_open": self.is_open(one.judged),
                    **figures_of(found.space.design_at(one.parameters), None).size_json(),
                }
                for one, file in zip(found.front, self.files, strict=True)
            ],
            "importance": self.importance,
        }

    def to_csv(self, rows: Sequence[Tried]) -> str:
        """Designs as a CSV table: number, digest, fields, figures, verdict, and the reason of an early stop."""
        found = self.findings
        figures = [name for name in FIGURES if any(name in one.judged.figures for one in found.tried)]
        paths = [field.path for field in found.space.fields]
        front = {one.number for one in found.front}
        stream = io.StringIO()
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(
            [
                "number",
                "digest",
                *paths,
                *figures,
                "verdict",
                "feasible",
                "on_front",
                "seconds",
                "stopped_because",
                "headline",
            ]
        )
        for one in rows:
            values = [one.judged.figures.get(name) for name in figures]
            table.writerow(
                [
                    one.number,
                    one.digest,
                    *(one.parameters[path] for path in paths),
                    *("" if value is None else f"{value:.6g}" for value in values),
                    one.judged.verdict,
                    one.is_feasible,
                    one.number in front,
                    one.seconds,
                    one.judged.reason,
                    self.headline(one),
                ]
            )
        return stream.getvalue()


def plain(value: Any) -> Any:
    """Value of a varied parameter as plain data; for a choice among alternatives, its label."""
    if not isinstance(value, str):
        return value
    return json.loads(value)


@contextmanager
def telling(*, quiet: bool) -> Iterator[OnTried | None]:
    """Live progress of a search on standard error: a bar with the best figures so far, or lines without a terminal."""
    if quiet:
        yield None
    elif sys.stderr.isatty():
        yield from _bar()
    else:
        yield _lines()


def _bar() -> Iterator[OnTried]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("base design", total=None)

        def tell(found: Findings, _: Tried | None) -> None:
            bars.update(task, completed=len(found.tried), total=found.wanted, description=standing(found))

        yield tell


def _lines() -> OnTried:
    last = {"time": -LINE_EVERY_S, "front": -1.0}

    def tell(found: Findings, _: Tried | None) -> None:
        front = hash(tuple(best.digest for best in found.front))
        now = time.monotonic()
        if front != last["front"] or now - last["time"] >= LINE_EVERY_S or len(found.tried) == found.wanted:
            last.update(time=now, front=front)
            print(f"{len(found.tried):>6} of {found.wanted}  {standing(found)}", file=sys.stderr)

    return tell


def standing(found: Findings) -> str:
    """Text with the best value so far of each objective, and the value of the base design."""
    parts = [f"front {len(found.front)}"]
    for objective in found.space.objectives:
        values = [value for one in found.front if (value := one.judged.figures[objective.figure]) is not None]
        base = found.base.figures.get(objective.figure)
        if values:
            best = min(values) if objective.sense == "minimize" else max(values)
            parts.append(
                f"{objective.figure} {best:.3g}" + (f" (base {base:.3g})" if base is not None else "")
            )
    return ", ".join(parts)
