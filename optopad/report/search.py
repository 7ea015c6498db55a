"""The page of a search, in one self-contained file: results, requirements, and the effect of each field."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

from markupsafe import Markup

from optopad.design.fields.base import get_at
from optopad.design.search.figures import FIGURES
from optopad.design.search.improve import Judged
from optopad.fabrication.bundle import versions
from optopad.report.before_after import before_and_after
from optopad.report.words import asset, inlined, part
from optopad.screen.answer import counted
from optopad.screen.improvement import Improvement
from optopad.screen.search import QUICK_ERRORS, Search
from optopad.sims.plots.front import choice_text, front_panels, importance_svg, parallel_svg, words

SHOWN_REASONS = 12


def search_page(search: Search, improvement: Improvement | None = None) -> str:
    """The page of a search as HTML text; if `improvement` is given, the page begins with that result."""
    found = search.findings
    count = len(found.front)
    word = f"{counted(count, 'design')} on the front" if count else "No design meets the limits"
    has_better = any(one.digest != _base_digest(search) for one in found.front)
    is_good = has_better
    if improvement is not None:
        count = len(improvement.alternatives)
        word = counted(count, "better design") if count else "No better design in reach"
        is_good = bool(count)
    is_finished = len(found.tried) >= found.wanted
    return part(
        "search",
        style=asset("page.css"),
        name=found.space.name,
        digest=found.space.digest,
        first="" if improvement is None else before_and_after(improvement),
        found=found,
        word=word,
        is_good=is_good,
        state="interrupted" if found.is_interrupted else "finished" if is_finished else "under way",
        gains=list(_gains(search)) if has_better else [],
        panels=map(inlined, front_panels(found.space, found.base, found.tried, found.front)),
        parallel=inlined(parallel_svg(found.space, found.tried, found.front)),
        importance=inlined(importance_svg(found.space, search.importance)) if search.importance else "",
        stopped=_stopped(search),
        space_rows=_space_rows(search),
        files=list(search.files),
        quick_error=QUICK_ERRORS.get(found.space.accuracy),
        choice_text=choice_text,
        **_front(search),
    )


def _base_digest(search: Search) -> str:
    point = search.findings.space.base_parameters()
    return search.findings.space.design_at(point).digest if point is not None else ""


def _gains(search: Search) -> Iterator[str]:
    found = search.findings
    for objective in found.space.objectives:
        name = objective.figure
        values = [float(one.judged.figures[name] or 0.0) for one in found.front]
        best = min(values) if objective.sense == "minimize" else max(values)
        base = found.base.figures.get(name)
        against = "" if base is None else f" against {_number(base, name)} of the base design"
        yield f"{words(name)}: {_number(best, name)}{against}"


def _front(search: Search) -> dict[str, list[Any]]:
    """Heads and rows of the table with the designs of the front, below the base design."""
    found, fields = search.findings, search.findings.space.fields
    names = [objective.figure for objective in found.space.objectives]
    names += [name for name in FIGURES if name not in names and name in found.base.figures]
    heads = ["design", *(_breakable(field.path) for field in fields), *map(_title, names), "verdict"]
    rows = [["base design", *_base_values(search), *_figures(found.base, names), search.base_headline]]
    for one, file in zip(found.front, search.files, strict=True):
        link = Markup('<a href="{}">{}</a>').format(file, one.number)
        values = [_value(one.parameters[field.path], field.choices is not None) for field in fields]
        rows.append([link, *values, *_figures(one.judged, names), search.headline(one)])
    return {"heads": heads, "rows": rows}


def _stopped(search: Search) -> list[tuple[str, int]]:
    """The most frequent reasons why designs were stopped early, with the numbers of designs."""
    kinds = Counter(_kind(one.judged.reason) for one in search.findings.tried if one.judged.reason)
    return kinds.most_common(SHOWN_REASONS)


def _kind(reason: str) -> str:
    """The reason why a design was stopped early, without the numbers of that design."""
    if ", required " in reason:
        return f"misses {reason.partition(', required ')[2]}"
    return reason.partition("(")[0].strip() or reason


def _space_rows(search: Search) -> list[tuple[str, str]]:
    space, found = search.findings.space, search.findings
    rows = [("base design", f"{space.base.name}, digest {space.base.digest[:8]}")]
    for field in space.fields:
        if field.choices is not None:
            text = "; ".join(choice_text(label) for label in field.labels)
        else:
            steps = f", steps of {field.step:g}" if field.step else ", logarithmic" if field.log else ""
            text = f"{field.low:g} to {field.high:g}{steps}"
        rows.append((_breakable(field.path), text))
    for objective in space.objectives:
        rows.append((f"{objective.sense} {words(objective.figure)}", FIGURES[objective.figure].meaning))
    rows += [("limit", str(limit)) for limit in found.limits]
    settings = space.search
    rows.append(
        ("sampler", f"{settings.sampler}, seed {settings.seed}, {settings.batch} designs proposed at once")
    )
    rows.append(("light", f"{space.accuracy} accuracy (docs/validation/search.md)"))
    rows.append(("versions", ", ".join(f"{name} {version}" for name, version in versions().items())))
    return rows


def _base_values(search: Search) -> list[str]:
    document = search.findings.space.base.model_dump(mode="json")
    found = []
    for field in search.findings.space.fields:
        value = get_at(document, field.path)
        found.append("as given" if isinstance(value, list | dict) else str(value))
    return found


def _figures(judged: Judged, names: list[str]) -> list[str]:
    return [_number(judged.figures.get(name), name) for name in names]


def _number(value: float | None, name: str) -> str:
    if value is None:
        return "-"
    return f"{value:.3e}" if name == "strength" else f"{value:.3g}"


def _title(name: str) -> str:
    unit = FIGURES[name].unit
    return words(name) if unit == "1" else f"{words(name)} [{unit}]"


def _value(value: object, is_choice: bool) -> str:
    return choice_text(str(value)) if is_choice else str(value)


def _breakable(path: str) -> str:
    """A dotted path that may be broken after its dots and underscores, to fit a narrow column."""
    return path.replace(".", ".\u200b").replace("_", "_\u200b")
