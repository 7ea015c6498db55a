"""The page of a search, in one self-contained file: results, requirements, and the effect of each field."""

from __future__ import annotations

from optopad.design.search.figures import FIGURES
from optopad.design.search.improve import Judged
from optopad.fabrication.bundle import versions
from optopad.report.before_after import before_and_after
from optopad.report.words import Html, bullets, element, facts, section, still_page, table
from optopad.screen.answer import counted
from optopad.screen.improvement import Improvement
from optopad.screen.search import QUICK_ERRORS, Search
from optopad.sims.plots.front import choice_text, front_panels, importance_svg, parallel_svg, words

SHOWN_REASONS = 12
LOCATIONS = {
    "front": "Front",
    "coordinates": "Designs",
    "importance": "Importance",
    "stopped": "Stopped early",
    "space": "Space",
    "files": "Files",
}


def search_page(search: Search, improvement: Improvement | None = None) -> str:
    """The page of a search as HTML text; if `improvement` is given, the page begins with that result."""
    found = search.findings
    first = Html("") if improvement is None else before_and_after(improvement)
    sections = [
        *([first] if first else []),
        _front_section(search),
        _coordinates_section(search),
        _importance_section(search),
        _stopped_section(search),
        _space_section(search),
        _files_section(search),
    ]
    titles = ({"before-after": "Before and after"} if first else {}) | LOCATIONS
    banner = _banner(search, improvement)
    return still_page("search", found.space.name, found.space.digest, titles, banner, sections)


def _banner(search: Search, improvement: Improvement | None) -> Html:
    found = search.findings
    count = len(found.front)
    better = [one for one in found.front if one.digest != _base_digest(search)]
    word = (
        f"{count} design{'s' if count != 1 else ''} on the front" if count else "No design meets the limits"
    )
    if improvement is not None:
        count = len(improvement.alternatives)
        word = counted(count, "better design") if count else "No better design in reach"
    state = (
        "interrupted"
        if found.is_interrupted
        else "finished"
        if len(found.tried) >= found.wanted
        else "under way"
    )
    lines = [
        element("h2", word, class_="word"),
        element(
            "p",
            f"{len(found.tried)} of {found.wanted} designs judged ({state}), "
            f"{sum(bool(one.judged.reason) for one in found.tried)} of them stopped early. "
            + (f"{found.space.description}." if found.space.description else ""),
            class_="meaning",
        ),
    ]
    if better:
        lines.append(element("p", *_gains(search)))
    is_good = bool(better) if improvement is None else bool(improvement.alternatives)
    return element("div", *lines, class_="verdict " + ("contiguous" if is_good else "out_of_model_scope"))


def _base_digest(search: Search) -> str:
    point = search.findings.space.base_parameters()
    return search.findings.space.design_at(point).digest if point is not None else ""


def _gains(search: Search) -> list[str]:
    found, parts = search.findings, []
    for objective in found.space.objectives:
        values = [float(one.judged.figures[objective.figure] or 0.0) for one in found.front]
        best = min(values) if objective.sense == "minimize" else max(values)
        base = found.base.figures.get(objective.figure)
        parts.append(
            f"{words(objective.figure)}: {_number(best, objective.figure)}"
            + (f" against {_number(base, objective.figure)} of the base design" if base is not None else "")
        )
    return ["Best of each: " + "; ".join(parts) + "."]


def _front_section(search: Search) -> Html:
    found = search.findings
    panels = front_panels(found.space, found.base, found.tried, found.front)
    pictures = [element("figure", element("div", _svg(panel), class_="card plot")) for panel in panels]
    figure = element(
        "div",
        element("div", *pictures, class_="grid"),
        element("p", "Every design that was judged to the end, in each pair of objectives.", class_="note"),
    )
    names = [objective.figure for objective in found.space.objectives]
    others = [name for name in FIGURES if name not in names and name in found.base.figures]
    heads = [
        "design",
        *(_breakable(field.path) for field in found.space.fields),
        *(f"{words(name)}{_unit(name)}" for name in (*names, *others)),
        "verdict",
    ]
    rows = [
        [
            "base design",
            *_base_values(search),
            *_figures(found.base, (*names, *others)),
            search.base_headline,
        ]
    ]
    for one, file in zip(found.front, search.files, strict=True):
        values = [
            _value(one.parameters[field.path], field.choices is not None) for field in found.space.fields
        ]
        link = element("a", f"{one.number}", href=file)
        rows.append([link, *values, *_figures(one.judged, (*names, *others)), search.headline(one)])
    grid = table(
        heads,
        rows,
        label="Designs of the front and the base",
        numeric=range(len(found.space.fields) + 1, len(heads) - 1),
        class_="wide",
    )
    note = element(
        "p",
        "A number opens the design file: check it with optopad check, make its bundle with optopad run. "
        + _light(search),
        class_="note",
    )
    return section("front", "Pareto front", figure, grid, note)


def _light(search: Search) -> str:
    """Text on the light model's setting for the designs in the table, and when it leaves a verdict undecided."""
    accuracy = search.findings.space.accuracy
    if accuracy == "score":
        return "The rows were judged by the light of optopad score, each location traced once."
    return (
        "The rows were judged by the quick light of a search and a coarse map; optopad score gives the "
        f"figures of the verdict. Undecided: the margin is within {QUICK_ERRORS[accuracy]:g} sigma of a "
        "deadband, the largest error found for quick margins; score the design."
    )


def _coordinates_section(search: Search) -> Html:
    found = search.findings
    picture = parallel_svg(found.space, found.tried, found.front)
    caption = "One line per design: fields on the left, objectives on the right. The front is drawn bold."
    labels = [
        element(
            "p", f"{field.path}, first to last: " + "; ".join(choice_text(label) for label in field.labels)
        )
        for field in found.space.fields
        if field.choices is not None
    ]
    # The drawing has too many axes to fit on a phone, where it is scrolled sideways.
    drawn = element("div", _svg(picture), style="width: max-content; min-width: 100%; background: #fff")
    wide = element(
        "div", drawn, class_="scroll", tabindex="0", role="region", aria_label="Parallel coordinates"
    )
    figure = element("figure", wide, element("figcaption", caption))
    return section("coordinates", "All designs", figure, *labels)


def _importance_section(search: Search) -> Html:
    if not search.importance:
        text = "Too few designs were judged to the end to estimate the importance of fields."
        return section("importance", "Importance of the fields", element("p", text))
    picture = importance_svg(search.findings.space, search.importance)
    caption = (
        "PED-ANOVA over the designs judged to the end: the difference between the values of a field in "
        "the best tenth and all its values. Interactions are not separated."
    )
    figure = element(
        "figure", element("div", _svg(picture), class_="card plot"), element("figcaption", caption)
    )
    return section("importance", "Importance of the fields", figure)


def _stopped_section(search: Search) -> Html:
    counts: dict[str, int] = {}
    for one in search.findings.tried:
        if one.judged.reason:
            kind = _kind(one.judged.reason)
            counts[kind] = counts.get(kind, 0) + 1
    if not counts:
        return section("stopped", "Stopped early", element("p", "No design was."))
    ranked = sorted(counts.items(), key=lambda item: -item[1])[:SHOWN_REASONS]
    grid = table(
        ["reason", "designs"],
        [[kind, str(count)] for kind, count in ranked],
        label="Why designs were stopped",
        numeric=[1],
    )
    return section("stopped", "Stopped early", grid)


def _kind(reason: str) -> str:
    """The reason why a design was stopped early, without the numbers of that design."""
    if ", required " in reason:
        return f"misses {reason.partition(', required ')[2]}"
    return reason.partition("(")[0].strip() or reason


def _space_section(search: Search) -> Html:
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
    return section("space", "Search space", facts(rows))


def _files_section(search: Search) -> Html:
    names = ["designs.csv", "front.csv", "front.json", "front.svg", "space.json"]
    items = [element("a", name, href=name) for name in (*names, *search.files)]
    return section("files", "Files", bullets(items, class_="files"))


def _base_values(search: Search) -> list[str]:
    from optopad.design.fields.base import get_at

    document = search.findings.space.base.model_dump(mode="json")
    found = []
    for field in search.findings.space.fields:
        value = get_at(document, field.path)
        found.append("as given" if isinstance(value, list | dict) else str(value))
    return found


def _figures(judged: Judged, names: tuple[str, ...]) -> list[str]:
    return [_number(judged.figures.get(name), name) for name in names]


def _number(value: float | None, name: str) -> str:
    if value is None:
        return "-"
    return f"{value:.3e}" if name == "strength" else f"{value:.3g}"


def _unit(name: str) -> str:
    unit = FIGURES[name].unit
    return "" if unit == "1" else f" [{unit}]"


def _value(value: object, is_choice: bool) -> str:
    return choice_text(str(value)) if is_choice else str(value)


def _breakable(path: str) -> str:
    """A dotted path that may be broken after its dots and underscores, to fit a narrow column."""
    return path.replace(".", ".\u200b").replace("_", "_\u200b")


def _svg(text: str) -> Html:
    """A drawing as part of the page, without the text before its ``<svg`` tag."""
    return Html(text[text.index("<svg") :])
