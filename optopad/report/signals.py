"""Sections on what the light does: signals of pairs, all judged pairs, the map, tolerance."""

from __future__ import annotations

from optopad.report.drawings import Drawing, figure_of, shown_pairs
from optopad.report.markup import Html, element, section, table
from optopad.report.numbers import DASH, counted, depth, ends, signed, spans
from optopad.report.words import clipping
from sims.verdict.defaults import DEADBAND_MIN_LENGTH_MM, DEADBAND_THRESHOLD, TRACE_ERROR_LIMIT
from sims.verdict.result import ContinuityScore, JudgedPair
from sims.verdict.tolerance import ToleranceBand

Drawings = dict[str, Drawing]

ONE_PLACE = (
    "The pad is tried at its weakest place, by the few pairs that answer most there: fewer pairs can only lengthen a "
    "deadband. Other places are not tried."
)
PAIR_HEADS = (
    "pair",
    "press at x, y",
    "mode 1",
    "mode 2",
    "gap",
    "deadband",
    "flat beyond mode 2",
    "continuity",
    "evenness",
    "counts untouched",
    "swing",
    "steps",
    "clipped",
    "trace error",
    "deadband with it",
)


def signal_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """Signal against depth of the pairs that matter."""
    lead = (
        "Facing rows are judged by their facing pairs, the middle one first."
        if score.is_facing_rows
        else f"A pad is judged by its places (next section). Of its {len(score.pairs)} judged pairs these show "
        "the range; each is pressed at the middle of its own chord."
    )
    figures = [
        figure_of(
            drawings[f"signal-{pair.name}"],
            f"{pair.name}, {role}, pressed at x = {pair.curves.press_mm[0]:.1f}, "
            f"y = {pair.curves.press_mm[1]:.1f} mm. {_reading(pair)}",
        )
        for pair, role in shown_pairs(score)
    ]
    return section(
        "signals",
        "Signal against depth",
        element("p", lead),
        element(
            "p",
            "Mode 1: the dimple takes away light that the top mirrors. Mode 2: the tip blocks the straight path. "
            "Light is shown before noise and clipping, over the untouched total.",
            class_="note",
        ),
        element("div", *figures, class_="grid"),
    )


def _reading(pair: JudgedPair) -> str:
    gap, dead = pair.score.modes.gap_mm, pair.score.deadbands_mm
    if gap is None:
        apart = "Mode 2 does not begin within the depth"
    else:
        apart = f"The modes overlap by {-gap:.2f} mm" if gap < 0 else f"The modes are {gap:.2f} mm apart"
    blind = f" {clipping(pair)}." if clipping(pair) else ""
    return f"{apart}; {'deadband ' + spans(dead) + ' mm' if dead else 'no deadband'}.{blind}"


def pairs_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """Every judged pair, as a picture and as a table."""
    unjudged = ", ".join(f"{name} {counts:.1f}" for name, counts in score.unjudged.items())
    rest = []
    if unjudged:
        summary = element(
            "summary", f"{counted(len(score.unjudged), 'pair')} not judged, with untouched counts"
        )
        rest.append(element("details", summary, element("p", unjudged, class_="note")))
    return section(
        "pairs",
        "All judged pairs",
        figure_of(
            drawings["pairs"], "Where in depth each pair's modes and deadbands lie, each under its own press."
        ),
        table(
            PAIR_HEADS,
            [_pair_row(pair) for pair in score.pairs],
            label="Judged pairs",
            numeric=range(1, len(PAIR_HEADS)),
            class_="pairs",
        ),
        element(
            "p",
            "Depths, gaps and places in mm. Flat beyond mode 2 is saturation, not a deadband. Steps: range of the "
            f"signal over {DEADBAND_THRESHOLD:g} noise units. Clipped: share of the depth above full scale. "
            f"Trace error: largest standard error of the simulated light in noise units; the verdict wants at most "
            f"{TRACE_ERROR_LIMIT:g}. Deadband with it: what that error may hide, with the deadbands found.",
            class_="note",
        ),
        *rest,
    )


def _pair_row(pair: JudgedPair) -> tuple[str, ...]:
    score, modes = pair.score, pair.score.modes
    onset, end = modes.mode2_mm
    gap = signed(modes.gap_mm)
    if modes.gap_at_least_mm is not None:
        gap = f"over {modes.gap_at_least_mm:.2f}"
    return (
        pair.name,
        f"{pair.curves.press_mm[0]:.1f}, {pair.curves.press_mm[1]:.1f}",
        spans([modes.mode1_mm], between=DASH),
        "never" if onset is None else f"{onset:.2f}{DASH}{depth(end)}",
        gap,
        spans(score.deadbands_mm, between=DASH),
        "none" if score.saturation_mm is None else spans([score.saturation_mm], between=DASH),
        f"{score.continuity:.2f}",
        f"{score.evenness:.2f}",
        f"{score.strength.untouched_counts:.0f}",
        f"{score.strength.swing:.0%}",
        f"{score.strength.resolvable_steps:.0f}",
        f"{score.clipped_share:.0%}" if score.is_clipped else "no",
        "not given" if score.noise_margin is None else f"{score.noise_margin:.2f}",
        "not given"
        if score.possible_deadbands_mm is None
        else spans(score.possible_deadbands_mm, between=DASH),
    )


def map_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """The pad, place by place."""
    pad_map = score.pad_map
    if pad_map is None:
        return Html("")
    weakest = pad_map.weakest
    figures = []
    if "map-deadband" in drawings:
        figures.append(
            figure_of(
                drawings["map-deadband"],
                "Summed deadband of all judged pairs together. Framed: the worst place, "
                f"{spans(pad_map.worst.deadbands_mm)} mm.",
            )
        )
    figures.append(
        figure_of(
            drawings["map-margin"],
            f"Change of the most responsive pair over the least responsive {DEADBAND_MIN_LENGTH_MM:g} mm of depth; "
            f"below {DEADBAND_THRESHOLD:g} noise units is a deadband. Framed: the weakest place, "
            f"{weakest.margin:.1f} noise units (the light trace's own error there is {weakest.trace_error:.1f}); "
            f"{counted(weakest.answering_pairs, 'pair')} answer there.",
        )
    )
    lead = f"{counted(len(pad_map.places), 'place')} pressed; {pad_map.dead_share:.0%} have a deadband."
    if score.is_facing_rows:
        lead += " It pools every pair with a direct path, and is not what facing rows are judged by."
    return section(
        "map",
        "Map of the pad",
        element("p", lead),
        element("div", *figures, class_="grid"),
        element(
            "p",
            "Dots on the walls: emitters; squares: receivers. Dashed: the workspace. A cell is the press at its "
            "centre; what lies between places was not computed.",
            class_="note",
        ),
    )


def tolerance_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """How firm the verdict is."""
    band = score.tolerance
    if band is None:
        return Html("")
    if not (band.rows or band.unbanded):
        return section(
            "tolerance", "Tolerance", element("p", "Every value that the verdict rests on was measured.")
        )
    figures = [
        figure_of(drawings[name], caption)
        for name, caption in (
            (
                "tolerance-deadband",
                "Deadband, the strongest effect first. Starred: turns the verdict.",
            ),
            ("tolerance-gap", "Mode gap: below 0 the modes overlap."),
            (
                "tolerance-margin",
                "Change over the least responsive 0.3 mm of depth; below 3 noise units is a deadband.",
            ),
        )
        if name in drawings
    ]
    return section(
        "tolerance",
        "Tolerance",
        element("p", _tolerance_lead(band)),
        *([] if score.is_facing_rows else [element("p", ONE_PLACE)]),
        element("div", *figures, class_="grid"),
        _tolerance_table(band) if band.rows else Html(""),
        _unbanded(band),
    )


def _tolerance_lead(band: ToleranceBand) -> str:
    low, high = band.deadband_range_mm
    turned = (
        f"Measure first what turns the verdict: {', '.join(band.flipping)}."
        if band.flipping
        else "No single value turns the verdict."
    )
    return (
        f"{counted(len(band.rows), 'value')} behind the verdict of {band.judged} were never measured on the build. "
        f"One at a time, at both ends of its band, with the gain set anew: the deadband is {low:.2f} to {high:.2f} mm "
        f"({band.deadband_mm:.2f} mm as designed). {turned}"
    )


def _tolerance_table(band: ToleranceBand) -> Html:
    rows = [
        (
            row.path,
            row.confidence,
            ends(*row.values),
            f"{row.deadband_mm[0]:.2f} / {row.deadband_mm[1]:.2f}",
            f"{signed(row.gap_mm[0])} / {signed(row.gap_mm[1])}",
            f"{row.margin[0]:.1f} / {row.margin[1]:.1f}",
            element("strong", "turns it") if row.flips else "no",
        )
        for row in band.rows
    ]
    heads = (
        "value",
        "confidence",
        "band",
        "deadband at low / high [mm]",
        "mode gap at low / high [mm]",
        "margin at low / high [noise units]",
        "verdict",
    )
    return table(heads, rows, label="Tolerance of the verdict", numeric=(2, 3, 4, 5), class_="wide")


def _unbanded(band: ToleranceBand) -> Html:
    if not band.unbanded:
        return Html("")
    names = ", ".join(band.unbanded)
    return element("p", f"Without a band, so that nothing can be said of them: {names}.", class_="note")
