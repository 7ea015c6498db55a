"""How results are shown: as text on the command line; in a notebook as a headline, a small table and a picture.

The answer of a score is all texts that a screen shows, as plain data that a bundle keeps (`sims/answer.json`). A
command that finds its bundle up to date shows the same lines from this file, without the models. The command as typed
is put in at the end: `COMMAND` stands for it.
"""

from __future__ import annotations

import json
import shlex
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 6.4
INTERRUPTED = 130
"""Exit code of an interrupted command."""


class Result(ABC):
    """Base class of results; printing a result shows the same text as the command line."""

    @property
    def found(self) -> Self:
        """This result itself; scripts for earlier versions use this attribute."""
        return self

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """The result as plain data for JSON."""

    def to_dict(self) -> dict[str, Any]:
        """The data that the command line prints with ``--json``."""
        return self.to_json()

    @abstractmethod
    def lines(self) -> list[str]:
        """The result as text."""

    def screen(self) -> list[str]:
        """The lines that the command line prints: the result, and where its files are."""
        return self.lines()

    def __repr__(self) -> str:
        return "\n".join(self.lines())


def block(title: str, lines: Iterable[str], *parts: str) -> str:
    """HTML that shows a result in a notebook: a headline, lines of text, then the HTML pieces `parts`."""
    text = "".join(f"<div>{escape(line)}</div>" for line in lines)
    return f"<div><strong>{escape(title)}</strong>{text}{''.join(parts)}</div>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """HTML of a table of texts; `head` holds the column headings."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def picture(draw: Callable[[], Figure], salt: str) -> str:
    """HTML with a figure as SVG, in the style of the plots; `salt` makes the SVG's identifiers unique."""
    from optopad.sims.plots.style import plain_style, svg_text

    with plain_style():
        return svg_text(draw(), salt).partition("?>")[2]


def drawn(draw: Callable[[Axes], Axes], ax: Axes | None, height_in: float) -> Axes:
    """Draw into the given axes, or if `ax` is None into a new pyplot figure, and return the axes."""
    from optopad.sims.plots.style import plain_style

    with plain_style():
        if ax is None:
            from matplotlib import pyplot as plt

            _, ax = plt.subplots(figsize=(WIDTH_IN, height_in), layout="constrained")
        return draw(ax)


def number(value: float | None, digits: int = 2, missing: str = "-") -> str:
    """A number as text with `digits` decimals, or `missing` for None."""
    return missing if value is None else f"{value:.{digits}f}"


WIDTH, LINES = 100, 13
LABEL = 12
"""Width of the column of labels at the start of each line [characters]."""
FINDING_LINES = 4
"""Largest number of lines for one finding of the design rules."""
COMMAND = "{command}"


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Texts of a verdict; a text that does not apply is empty.

    Attributes
    ----------
    design : name and first digits of the digest
    verdict, why, margin, confidence, resolution : sentences (`optopad.screen.verdict_sentences.VerdictSentences`)
    verdict_lines : largest number of lines of the verdict
    learner : how to predict a learner's errors; it is shown where there is room
    has_learner : whether a learner's errors are shown at all
    warnings : warnings that no other line reports, as short forms, the most serious first
    tried : what was tried without success
    size : size, loads, parts and price
    onward, onward_built : the next command, before and after `optopad run`
    moves : fields that the next command changes, with their values
    details : all figures as lines, for ``--details``
    """

    design: str
    verdict: str
    why: str
    margin: str
    confidence: str
    resolution: str
    verdict_lines: int
    learner: str
    has_learner: bool
    warnings: tuple[str, ...]
    tried: str
    size: str
    onward: str
    onward_built: str
    moves: tuple[tuple[str, float], ...]
    details: tuple[str, ...]

    def to_text(self) -> str:
        """The answer as JSON."""
        return json.dumps(asdict(self), indent=2) + "\n"

    @classmethod
    def read(cls, file: Path) -> Self:
        """The answer in a file that `to_text` wrote."""
        found = json.loads(file.read_text(encoding="utf-8"))
        found |= {name: tuple(found[name]) for name in ("warnings", "details")}
        return cls(**found | {"moves": tuple((path, value) for path, value in found["moves"])})

    def lines(
        self, closing: Sequence[str], *, command: str = "", is_built: bool = False, learner: str = ""
    ) -> list[str]:
        """At most thirteen lines of a hundred characters: cause or margin, confidence, resolution, the next command.

        Parameters
        ----------
        closing : last lines, such as the paths of the files
        command : the design and its changes as typed; if empty, the next command is not shown
        is_built : whether the bundle already contains mold and report
        learner : sentence on a learner's predicted errors; if empty, how to predict them
        """
        head = [*row("design", self.design), *row("verdict", self.verdict, self.verdict_lines)]
        figures = [*row("confidence", self.confidence, 2), *row("resolution", self.resolution, 2)]
        onward = self.onward_built if is_built else self.onward
        foot = [*row("size", self.size), *closing]
        if command:
            foot += row("next", onward.replace(COMMAND, with_moves(command, self.moves)), 3)
        margin = row("margin", self.margin, 2)
        left = LINES - len(head) - len(margin) - len(figures) - len(foot) - 1
        head += [*row("cause", self.why, max(left, 2)), *margin, *figures]
        told = learner or (self.learner.replace(COMMAND, command) if command else "")
        reached = row("learner", told, 2) if self.has_learner else []
        if (
            len(head) + len(reached) + len(foot) + min(len(self.warnings), 2) <= LINES
        ):  # two lines for warnings
            head += reached
        warnings = _warnings(self.warnings, max(LINES - len(head) - len(foot), 1))
        tried = row("tried", self.tried, 2)
        if len(head) + len(warnings) + len(tried) + len(foot) <= LINES:
            head += tried
        return [*head, *warnings, *foot]


def row(label: str, text: str, most: int = 1) -> list[str]:
    """Lines of a labelled sentence, wrapped to at most `most` lines; no lines for an empty sentence."""
    if not text:
        return []
    room = WIDTH - LABEL
    parts = wrap(text, room, break_long_words=False, break_on_hyphens=False)
    if len(parts) > most:
        last = " ".join(parts[most - 1 :])
        parts = [*parts[: most - 1], shorten(last, room, placeholder=" …")]
    return [f"{label if number == 0 else '':<{LABEL}}{part}" for number, part in enumerate(parts)]


def labelled(label: str, text: str) -> str:
    """A labelled sentence of any length, on one line."""
    return f"{label:<{LABEL}}{text}"


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number with its noun, in singular or plural."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def as_typed(design: str, changes: Sequence[str] | None) -> str:
    """A design and its changes as typed on the command line."""
    return " ".join([shlex.quote(design), *(f"--set {shlex.quote(one)}" for one in changes or ())])


def with_moves(command: str, moves: Sequence[tuple[str, float]]) -> str:
    """Design and changes as typed, with other changes added; each replaces an earlier change of the same field."""
    if not moves:
        return command
    design, *changes = shlex.split(command)
    fields = {path for path, _ in moves}
    kept = [text for text in changes if text != "--set" and text.split("=")[0].strip() not in fields]
    return as_typed(design, [*kept, *(f"{path}={to:g}" for path, to in moves)])


def checks_line(checks: Mapping[str, Any]) -> str:
    """Line that summarises the checks of the mold."""
    return f"mold      {checks_words(checks)}"


def checks_words(checks: Mapping[str, Any]) -> str:
    """Text that says whether the mold can be printed, and which checks failed."""
    found = {
        state: [one["name"] for one in checks.get("findings", []) if one.get("state") == state]
        for state in ("error", "warning")
    }
    named = [f"{counted(len(names), state)} ({', '.join(names)})" for state, names in found.items() if names]
    state = "printable" if checks.get("ok") else "NOT printable"
    if not named:
        return f"{state}, no findings (cad/checks.json)"
    return f"{state}, {', '.join(named)}; see cad/checks.json"


def board_words(bundle: Path) -> str:
    """Text that says whether the circuit board of a bundle is finished, from its notes; empty without notes."""
    try:
        notes = (bundle / BOARD_NOTES).read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    warned = [line.removeprefix("WARNING: ") for line in notes if line.startswith("WARNING: ")]
    if warned:
        return warned[0]
    size = notes[1].removeprefix("Size ").split(",")[0] if len(notes) > 1 else "made"
    return f"{size}, every connection has a track (read {BOARD_NOTES} before you order)"


BOARD_NOTES = "fabrication/board/notes.txt"
LEAST_DEPTH_MM = 1.0
"""Least depth for which a learner's errors are reported [mm]; lighter presses are detected, but hardly located."""


def learner_words(bundle: Path, digest: str) -> str:
    """Sentence on the errors that `optopad predict` wrote into a design's bundle; empty if there are none."""
    try:
        found = json.loads((bundle / "sims" / "prediction.json").read_text(encoding="utf-8"))
        return _reached(found) if found["digest"] == digest else ""
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return ""


def _reached(document: Mapping[str, Any]) -> str:
    every = document.get("learners", [document])  # earlier files have the first learner's tables only
    found = [(medians, one) for one in every if all(medians := _medians(one["errors"]))]
    if not found:
        return ""
    (location, depth), best = min(found, key=lambda one: sum(one[0][0]) / len(one[0][0]))
    alarms = best.get("false_alarms")
    false = "" if alarms is None else f"; {100.0 * alarms:.0f} % false alarms"
    return f"location {_range(location, 2)}, depth {_range(depth, 2)} ({best['learner']}, simulated){false}"


def _medians(rows: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    deep = [row for row in rows if row["depth_mm"] >= LEAST_DEPTH_MM]
    location, depth = (
        [float(row[name]) for row in deep if row[name] is not None]
        for name in ("location_median_mm", "depth_median_mm")
    )
    return location, depth


def _range(values: Sequence[float], digits: int) -> str:
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return f"{high} mm" if low == high else f"{low} to {high} mm"


def _warnings(texts: Sequence[str], room: int) -> list[str]:
    """Lines with as many warnings as fit: one a line if there is room, otherwise one after the other."""
    apart = [line for text in texts for line in row("warning", text, 2)]
    if len(apart) <= room:
        return apart
    for count in range(len(texts), -1, -1):
        left = len(texts) - count
        more = [f"{counted(left, 'more warning' if count else 'warning')}: --details"] if left else []
        lines = row("warning", "; ".join([*texts[:count], *more]), room + 1)
        if len(lines) <= room:
            return lines
    return []
