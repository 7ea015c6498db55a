"""What a search finds, how fast, and how far its quick figures are from the score's: docs/validation/search.md.

    python -m tests.validation.verdict.search_table          (ten minutes of two cores; interrupted, it goes on)

The searches are `pad-layout` and `pair-heights`, in build/validation/search. Of each, the base design and some of the
front are judged again with the score's own settings; what is judged is kept beside the study.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import numpy as np

from optopad.design.io import write_text_atomically
from optopad.design.search.explore import Findings
from optopad.design.search.figures import FIGURES
from optopad.design.search.improve import Judged, Tried
from optopad.design.search.space import SearchSpace, load_space
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import program_digest
from optopad.sims.plots.front import choice_text, front_svg
from optopad.sims.score.objective import judge
from optopad.verbs.explore import search
from tests.validation.verdict import improve_table

ROOT = Path(__file__).parents[3]
FOLDER = ROOT / "build" / "validation" / "search"
PAGE = ROOT / "docs" / "validation" / "search.md"
PICTURE = ROOT / "docs" / "images" / "search-front.svg"
TRIALS = {"pad-layout": 60, "pair-heights": 80}
CHECKED = {
    "pad-layout": ("evenness", "strength", "location_bound_mm", "depth_bound_mm"),
    "pair-heights": ("evenness", "strength", "resolvable_steps"),
}
WIDTH = 118
"""Of a line of the page."""
CHOSEN = 1
"""Designs of the pad's front that are judged again: one takes some 5 core-minutes."""
PAIR_SAMPLE = 4
"""Designs of the pair that are judged both ways, evenly from all that were judged to the end."""


METHOD = """\
- `optopad explore` proposes designs, judges each by its cheapest step first, and stops early where a design is out of
  the limits. It keeps the designs that no other design beats in every figure.
- *Search accuracy*: draft light, depths of pairs every 0.2 mm, map and bounds at 3 x 3 locations, bounds at 0.7 and
  2.5 mm and the end. *Score accuracy*: the settings of `optopad score` (5 x 5 locations, standard light).
- The base design and the best of the pad's front are judged again at score accuracy. So are a few designs of the pair,
  taken evenly from all that were judged to the end.
"""
MEANING = """\
- A search finds better pads than the paper's, at a price: four parts more, and `optopad check` names the receivers'
  bodies that are then above the rim. With the paper's 16 parts it found designs that gain less; they are in the
  picture, at search accuracy.
- The table suggests two reasons: five parts a side make 100 pairs in place of 64, and parts nearer to the surface let
  mode 2 begin sooner after mode 1. The two were not tried apart.
- **Score what a search has found before it is built.** The depth bound of the pad is its least certain figure: the
  median over 3 x 3 locations and three depths is not that of 5 x 5 and five. The order of similar designs may change.
  These are few designs: ratios, not a distribution.
- Not covered: tolerance of the heights (`optopad score --tolerance`), and the accuracy of a learner.
"""


def main() -> None:
    """Search, judge again, write the page."""
    found = {name: searched(name) for name in TRIALS}
    print({name: len(one.tried) for name, one in found.items()}, flush=True)
    pad, pair = found["pad-layout"], found["pair-heights"]
    chosen = best_of(pad)
    again = [judged_again(pad.space.base, "pad-layout")] + [
        judged_again(pad.space.design_at(one.parameters), "pad-layout") for one in chosen
    ]
    sample = whole_designs(pair)[:: max(1, len(whole_designs(pair)) // PAIR_SAMPLE)][:PAIR_SAMPLE]
    pairs = [
        (one.judged, judged_again(pair.space.design_at(one.parameters), "pair-heights")) for one in sample
    ]
    write_text_atomically(PICTURE, front_svg(pad.space, pad.base, pad.tried, pad.front))
    written, made = PAGE.read_text(encoding="utf-8"), page(pad, chosen, again, pair, pairs)
    if improve_table.BEGIN in written:  # its section stays
        kept = (
            written[written.index(improve_table.BEGIN) : written.index(improve_table.END)] + improve_table.END
        )
        made = made.replace("## What it means", f"{kept}\n\n## What it means", 1)
    write_text_atomically(PAGE, made)


def searched(name: str) -> Findings:
    """One packaged search, gone on with where it stopped."""
    return search(load_space(name), FOLDER, trials=TRIALS[name]).findings


def whole_designs(found: Findings) -> list[Tried]:
    """Designs judged to the end."""
    return [one for one in found.tried if not one.judged.reason]


def best_of(pad: Findings) -> list[Tried]:
    """The best of location and depth bound together, of each number of parts one, more parts first."""
    best: dict[float, Tried] = {}
    for one in pad.tried:
        if one.is_feasible and one.digest != base_digest(pad.space):
            count = float(one.judged.figures["part_count"] or 0.0)
            if count not in best or gain(pad, one) > gain(pad, best[count]):
                best[count] = one
    return [best[count] for count in sorted(best, reverse=True)][:CHOSEN]


def base_digest(space: SearchSpace) -> str:
    point = space.base_parameters()
    return "" if point is None else space.design_at(point).digest


def gain(pad: Findings, one: Tried) -> float:
    """Product of the base's bounds over the design's."""
    names = ("location_bound_mm", "depth_bound_mm")
    return float(np.prod([ratio(pad.base, one.judged, name) for name in names]))


def ratio(above: Judged, below: Judged, name: str) -> float:
    return float(above.figures[name] or 0.0) / float(below.figures[name] or np.inf)


def judged_again(design: SensorDesign, name: str) -> Judged:
    """Figures with the score's own settings; kept in a file of these sources, so that an interrupted run goes on."""
    file = FOLDER / f"score-{design.digest[:16]}-{program_digest()[:8]}.json"
    if not file.is_file():
        started = time.process_time()
        found = judge(design, (), wanted=(*CHECKED[name], "verdict"), accuracy="score")
        record = {"figures": found.figures, "verdict": found.verdict, "reason": found.reason}
        record["cpu_s"] = round(time.process_time() - started, 1)
        write_text_atomically(file, json.dumps(record, indent=2) + "\n")
    known = json.loads(file.read_text(encoding="utf-8"))
    return Judged(figures=known["figures"], verdict=known["verdict"], reason=known["reason"])


def page(
    pad: Findings,
    chosen: list[Tried],
    again: list[Judged],
    pair: Findings,
    pairs: list[tuple[Judged, Judged]],
) -> str:
    """The page as Markdown."""
    return "\n".join(
        [
            "# The search: accuracy, and a better pad than the paper's",
            "",
            "**Question.** Does a search find a pad that beats the paper's, and how far are its quick figures from the",
            "score's?",
            "",
            *answer(chosen, again, [*pad_both(pad, chosen, again), *pairs]),
            "",
            "## Method",
            "",
            *METHOD.splitlines(),
            "",
            *better_pad(pad, chosen, again),
            *accuracy_section(pad, chosen, again, pairs),
            *pair_section(pair),
            "## What it means",
            "",
            *MEANING.splitlines(),
            "",
            "## Made by",
            "",
            "`python -m tests.validation.verdict.search_table`: ten minutes of two cores, resumable.",
            "",
        ]
    )


def answer(chosen: list[Tried], again: list[Judged], both: list[tuple[Judged, Judged]]) -> list[str]:
    """The result in a few lines; the first of the chosen is told."""
    agree = [quick.verdict == sure.verdict for quick, sure in both]
    off = (
        f"A search's figures are within {100 * furthest(both):.0f} % of the score's; "
        f"verdicts agree in {sum(agree)} of {len(agree)}."
    )
    if not chosen:
        return fill(f"**Answer.** It found none. {off}", WIDTH).splitlines()
    gains = beats(again[0], again[1])
    told = (
        f"**Answer.** Yes. Design {chosen[0].number} is {again[1].verdict} where the paper's pad is "
        f"{again[0].verdict}; its location bound is {gains['location_bound_mm']:.2f} times, its depth bound "
        f"{gains['depth_bound_mm']:.2f} times, its evenness {gains['evenness']:.2f} times as good. {off}"
    )
    return fill(told, WIDTH).splitlines()


def furthest(both: list[tuple[Judged, Judged]]) -> float:
    """How far a figure at search accuracy is from that at score accuracy at most, over the latter [-]."""
    names = {name for one in CHECKED.values() for name in one}
    ratios = [
        ratio(quick, sure, name)
        for quick, sure in both
        for name in names
        if quick.figures.get(name) and sure.figures.get(name)
    ]
    return float(np.abs(np.array(ratios) - 1.0).max())


def pad_both(pad: Findings, chosen: list[Tried], again: list[Judged]) -> list[tuple[Judged, Judged]]:
    """The base and the chosen at search and at score accuracy."""
    return list(zip([pad.base, *(one.judged for one in chosen)], again, strict=True))


def better_pad(pad: Findings, chosen: list[Tried], again: list[Judged]) -> list[str]:
    names = CHECKED["pad-layout"]
    different = len({one.digest for one in pad.tried if one.is_feasible})
    lines = [
        "## A pad that beats the paper's",
        "",
        f"`optopad explore pad-layout --trials {pad.wanted}` varies thickness, both heights and the parts a side of",
        f"`piacenza2017-pad`: {len(pad.tried)} designs proposed, "
        f"{sum(bool(one.judged.reason) for one in pad.tried)} stopped early, {different} different ones within all",
        "limits, the base one of them. The best, at score accuracy:",
        "",
        "| design | parts | clear mm | LED height mm | diode height mm | "
        + " | ".join(names)
        + " | verdict |",
        "|---|---|---|---|---|" + "---|" * (len(names) + 1),
        row("the paper's", pad.space.base, again[0], names),
    ]
    for one, judged in zip(chosen, again[1:], strict=True):
        lines.append(row(f"no. {one.number}", pad.space.design_at(one.parameters), judged, names))
    lines += [
        "",
        *conclusion(chosen, again),
        "",
        "![Pareto front of the pad search](../images/search-front.svg)",
        "",
    ]
    return lines


def row(label: str, design: SensorDesign, judged: Judged, names: Sequence[str]) -> str:
    cells = [
        label,
        f"{judged.figures['part_count']:.0f}",
        f"{design.cavity.clear_thickness_mm:g}",
        f"{design.emitters.height_mm:g}",
        f"{design.receivers.height_mm:g}",
        *("-" if judged.figures.get(name) is None else f"{judged.figures[name]:.3g}" for name in names),
        judged.verdict,
    ]
    return "| " + " | ".join(cells) + " |"


def beats(base: Judged, other: Judged) -> dict[str, float]:
    """Gain of each figure over the base's, above 1 where it is better."""
    found = {}
    for name in CHECKED["pad-layout"]:
        is_small = FIGURES[name].better == "minimize"
        found[name] = ratio(base, other, name) if is_small else ratio(other, base, name)
    return found


def conclusion(chosen: list[Tried], again: list[Judged]) -> list[str]:
    lines = []
    for one, judged in zip(chosen, again[1:], strict=True):
        gains = beats(again[0], judged)
        layout = choice_text(str(one.parameters["layout"]))
        lost = [name for name, gain_ in gains.items() if gain_ < 1.0]
        said = ", ".join(f"{name} x {value:.2f}" for name, value in gains.items())
        verdict = f"but loses in {', '.join(lost)}" if lost else "and loses in nothing"
        lines.append(
            f"- No. {one.number} ({layout}) gains {said} ({'better' if not lost else 'mixed'}, {verdict})."
        )
    return lines or ["It found none."]


def accuracy_section(
    pad: Findings, chosen: list[Tried], again: list[Judged], pairs: list[tuple[Judged, Judged]]
) -> list[str]:
    lines = [
        "## How far the search's figures are from the score's",
        "",
        "Ratio of a figure at search accuracy over the same at score accuracy:",
        "",
        "| search | figure | designs | mean | smallest | largest |",
        "|---|---|---|---|---|---|",
    ]
    for title, both, names in (
        ("pad", pad_both(pad, chosen, again), CHECKED["pad-layout"]),
        ("pair", pairs, CHECKED["pair-heights"]),
    ):
        for name in names:
            ratios = [ratio(a, b, name) for a, b in both if a.figures.get(name) and b.figures.get(name)]
            lines.append(
                f"| {title} | {name} | {len(ratios)} | {np.mean(ratios):.3f} | {min(ratios):.3f} | {max(ratios):.3f} |"
            )
    return [*lines, ""]


def pair_section(pair: Findings) -> list[str]:
    names = CHECKED["pair-heights"]
    lines = [
        "## The pair",
        "",
        f"`optopad explore pair-heights --trials {pair.wanted}`: {len(pair.tried)} designs, "
        f"{sum(bool(one.judged.reason) for one in pair.tried)} stopped early. Front, at search accuracy:",
        "",
        "| design | clear mm | LED height mm | diode height mm | " + " | ".join(names) + " |",
        "|---|---|---|---|" + "---|" * len(names),
    ]
    rows = [("the paper's", pair.space.base, pair.base)]
    rows += [(f"no. {one.number}", pair.space.design_at(one.parameters), one.judged) for one in pair.front]
    for label, design, judged in rows:
        cells = [label, f"{design.cavity.clear_thickness_mm:g}", f"{design.emitters.height_mm:g}"]
        cells += [
            f"{design.receivers.height_mm:g}",
            *(f"{judged.figures[name] or 0.0:.3g}" for name in names),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return [*lines, ""]


if __name__ == "__main__":
    main()
