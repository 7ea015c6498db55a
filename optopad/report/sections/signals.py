"""Sections on the signals: selected pairs, all judged pairs, sensitivity, tolerance."""

from __future__ import annotations

from optopad.design.spec import SensorDesign
from optopad.report.scenes.pair_scene import pair_scene
from optopad.report.sections.drawings import Drawing, figure_of, shown_causes, shown_pairs
from optopad.report.words import (
    Html,
    builds_table,
    builds_words,
    data_element,
    element,
    governing,
    pair_words,
    ranked,
    reading,
    section,
    table,
)
from optopad.screen.answer import counted
from optopad.screen.verdict_sentences import (
    DASH,
    cause_sentence,
    depth,
    ends,
    fix_words,
    no_fix_words,
    signed,
    spans,
)
from optopad.sims.score.result import ContinuityScore, JudgedPair
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD, TRACE_ERROR_LIMIT
from optopad.sims.verdict.tolerance import ToleranceBand
from optopad.sims.verdict.trial import Trial

Drawings = dict[str, Drawing]

ONE_PLACE = (
    "The bands are tried at the location of least margin, with the few pairs that respond most there: "
    "fewer pairs can only lengthen a deadband. Other locations are not tried."
)
CURVES = (
    ("total", "total"),
    ("direct", "direct (mode 2)"),
    ("top", "mirrored by the top (mode 1)"),
    ("other", "other, scattered"),
)
LACKS = {
    "apart": "modes apart",
    "slight": "changes too little",
    "cancel": "modes cancel",
    "used up": "saturated",
    "dim": "too little light",
}
"""Words for the reasons why a pair does not resolve depth, where the reason's own name is not clear."""
CAUSE_HEADS = (
    "pair",
    "lacks",
    "remaining reflected light",
    "remaining direct light",
    "counts untouched",
    "change [sigma]",
    "mode 1 ends at [mm]",
    "mode 2 begins at [mm]",
    "tip reaches the direct path at [mm]",
)
TRIAL_HEADS = ("move", "deadband [mm]", "usable depth [mm]", "margin [sigma]")
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
    "numerical error",
    "deadband with this error",
)


def causes_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """The section on causes of unresolved depth: cross-sections with the remaining light, and pairs under the tip."""
    causes = shown_causes(score)
    if not causes:
        return Html("")
    parts = []
    for number, cause in enumerate(causes, 1):
        x_mm, y_mm = cause.place_mm
        words = cause_sentence(cause)
        kind = "Deadband" if cause.kind == "deadband" else "Saturated"
        said = f"{kind} from {spans([cause.depth_mm])} mm at x = {x_mm:g}, y = {y_mm:g} mm: {words}."
        drawn = drawings.get(f"cause-{number}")
        parts.append(element("p", said) if drawn is None else figure_of(drawn, said))
    witnesses = causes[0].witnesses
    rows = [
        (
            one.pair,
            LACKS.get(one.lack, one.lack),
            f"{one.mirrored:.0%}",
            f"{one.straight:.0%}",
            f"{one.untouched_counts:.0f}",
            f"{one.change:.1f}",
            f"{one.mode1_end_mm:.2f}",
            "never" if one.mode2_onset_mm is None else f"{one.mode2_onset_mm:.2f}",
            f"{one.reach_mm:.2f}",
        )
        for one in witnesses
    ]
    return section(
        "why",
        "Why depth is not resolved",
        element("div", *parts, class_="grid"),
        table(
            CAUSE_HEADS, rows, label="Pairs under the tip", numeric=range(2, len(CAUSE_HEADS)), class_="wide"
        )
        if rows
        else Html(""),
        element(
            "p",
            "Solid: light unchanged; dashed: partly lost; dotted: lost. Hatched: the tip where the "
            "interval begins; dashed: where it ends; dotted: the tip next to the section. The table "
            "lists the pairs under the tip in the first picture.",
            class_="note",
        ),
        *_trial_parts(score.trial),
    )


def _trial_parts(trial: Trial | None) -> list[Html]:
    if trial is None:
        return []
    rows = [
        (
            ", ".join(f"{path} = {value:g}" for path, value in one.changes.items()),
            f"{one.deadband_mm:.2f}",
            f"{one.usable_mm:.2f}",
            f"{one.margin:.1f}",
        )
        for one in trial.tried
    ]
    said = "; ".join(filter(None, [fix_words(trial), no_fix_words(trial)]))
    return [
        element("p", f"Traced changes, judged by {trial.searched}: {said}."),
        table(TRIAL_HEADS, rows, label="Traced changes", numeric=range(1, len(TRIAL_HEADS))),
    ]


def signal_section(design: SensorDesign, score: ContinuityScore, drawings: Drawings) -> Html:
    """The section on signals: one judged pair that the user selects, and drawings of the most important pairs."""
    lead = (
        "Facing rows are judged by their facing pairs, the middle one first."
        if score.is_facing_rows
        else f"A pad is judged by its locations (next section). Of its {len(score.pairs)} judged pairs, "
        "these show the range; each is pressed at the middle of its own chord."
    )
    figures = [
        figure_of(
            drawings[f"signal-{pair.name}"],
            f"{pair.name}, {role}, pressed at x = {pair.curves.press_mm[0]:.1f}, "
            f"y = {pair.curves.press_mm[1]:.1f} mm. {reading(pair)}",
        )
        for pair, role in shown_pairs(score)
    ]
    return section(
        "signals",
        "Signal against depth",
        _picker(score),
        element("div", element("p", lead), element("div", *figures, class_="grid"), id="pairs-still"),
        element(
            "p",
            "Mode 1: the dimple reduces the light that the top mirrors. Mode 2: the tip blocks the "
            "direct path. Light is shown before noise and clipping, relative to the untouched total.",
            class_="note",
        ),
        data_element("pairs-data", pair_scene(design, score)),
    )


def _picker(score: ContinuityScore) -> Html:
    """The list of pairs, the worst first, and the view of the selected pair, which the page's script draws."""
    numbers = {pair.name: number for number, pair in enumerate(score.pairs)}
    listed = score.pairs if score.is_facing_rows else ranked(score)
    options = (element("option", _option(pair), value=str(numbers[pair.name])) for pair in listed)
    deepest = float(score.pairs[0].curves.depth_mm[-1])
    start = governing(score).score.modes.mode1_mm[1]
    slider = element(
        "input",
        type="range",
        min="0",
        max=f"{deepest:g}",
        step="0.01",
        value=f"{start:.2f}",
        id="pairs-depth",
    )
    legend = (
        element(
            "span",
            element("i", class_=f"key {name}", aria_hidden="true"),
            f" {words} ",
            element("b", "", data_value=name),
        )
        for name, words in CURVES
    )
    return element(
        "div",
        element(
            "div",
            element("label", "Pair ", element("select", *options, id="pair-choice")),
            element("button", "\N{LEFTWARDS ARROW}", type="button", data_step="-1", aria_label="Pair before"),
            element("button", "\N{RIGHTWARDS ARROW}", type="button", data_step="1", aria_label="Next pair"),
            class_="controls",
        ),
        element("p", "", data_reading="", class_="reading", aria_live="polite"),
        element("p", "", data_loads="", class_="note"),
        element(
            "div",
            Html('<svg data-plot="" role="img" class="live"></svg>'),
            Html('<svg data-plan="" role="img" class="live plan"></svg>'),
            class_="beside",
        ),
        element("p", *legend, class_="legend"),
        element(
            "div",
            element("label", "Depth ", slider),
            element("output", "", for_="pairs-depth"),
            element("span", "", data_at="", class_="note"),
            class_="controls",
        ),
        id="pairs-view",
        hidden="",
    )


def _option(pair: JudgedPair) -> str:
    dead = pair.score.deadband_total_mm
    return f"{pair.name}: {f'deadband {dead:.2f} mm' if dead else 'no deadband'}"


def pairs_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """The section on all judged pairs, as a picture and as a table."""
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
        pair_words(score),
        figure_of(drawings["pairs"], "Depths of each pair's modes and deadbands, each under its own press."),
        table(
            PAIR_HEADS,
            [_pair_row(pair) for pair in score.pairs],
            label="Judged pairs",
            numeric=range(1, len(PAIR_HEADS)),
            class_="pairs",
        ),
        element(
            "p",
            "Depths, gaps and locations in mm. Flat beyond mode 2 is saturation, not a deadband. Steps: "
            f"range of the signal over {DEADBAND_THRESHOLD:g} sigma. Clipped: share of the depth above "
            "full scale. Numerical error: largest standard error of the simulated light in sigma; the "
            f"verdict needs at most {TRACE_ERROR_LIMIT:g}. Deadband with this error: the deadbands found, "
            "with those that the error may hide.",
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
        element("a", pair.name, href="#signals", data_pair=pair.name),
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


def tolerance_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """The section on the confidence in the verdict, from the effect of tolerances."""
    band = score.tolerance
    if band is None:
        return Html("")
    if not (band.rows or band.unbanded):
        return section(
            "tolerance", "Tolerance", element("p", "Every value that the verdict depends on was measured.")
        )
    figures = [
        figure_of(drawings[name], caption)
        for name, caption in (
            (
                "tolerance-deadband",
                "Deadband, the strongest effect first. Starred: changes the verdict.",
            ),
            ("tolerance-gap", "Mode gap: below 0 the modes overlap."),
            (
                "tolerance-margin",
                "Margin: least change over 0.3 mm of depth; a deadband is below 3 sigma.",
            ),
        )
        if name in drawings
    ]
    return section(
        "tolerance",
        "Tolerance",
        *_builds(score, drawings),
        element("p", _tolerance_lead(band)),
        *([] if score.is_facing_rows else [element("p", ONE_PLACE)]),
        element("div", *figures, class_="grid"),
        _tolerance_table(band) if band.rows else Html(""),
        _unbanded(band),
    )


def matters_section(score: ContinuityScore, drawings: Drawings) -> Html:
    """The section on sensitivity: the effect of a small step of each parameter."""
    if score.steps is None or "field-steps" not in drawings:
        return Html("")
    x_mm, y_mm, depth_mm = score.steps.bounds_at_mm
    caption = (
        f"Judged by {score.steps.judged}, with a gain by rule recomputed; bounds of one frame at x = "
        f"{x_mm:g}, y = {y_mm:g}, {depth_mm:g} mm deep. Longer usable depth, less deadband, more margin "
        "and smaller bounds are better."
    )
    return section(
        "matters",
        "Sensitivity",
        element("p", "Effect of one parameter at a time, a step lower and a step higher."),
        figure_of(drawings["field-steps"], caption),
    )


def _builds(score: ContinuityScore, drawings: Drawings) -> list[Html]:
    """The part on the Monte Carlo study over all tolerances; empty if no units were drawn."""
    study = score.builds
    if study is None:
        return []
    shown = [
        figure_of(
            drawings["builds"],
            "Left: each value alone at both ends of its band. Right: its rank correlation with the margin over the "
            "manufactured units, with the 95 % interval; grey where the interval includes zero.",
        )
        for name in ("builds",)
        if name in drawings
    ]
    return [builds_words(study), *shown, builds_table(study)]


def _tolerance_lead(band: ToleranceBand) -> str:
    low, high = band.deadband_range_mm
    range_mm = f"the deadband is {low:.2f} to {high:.2f} mm ({band.deadband_mm:.2f} mm as designed)"
    dead = range_mm if round(high, 2) else "no deadband appears"
    turned = (
        f"Measure first the parameters that change the verdict: {', '.join(band.flipping)}."
        if band.flipping
        else "No single parameter changes the verdict."
    )
    return (
        f"{counted(len(band.rows), 'value')} behind the verdict of {band.judged} were not measured on the "
        f"built pad. Each is varied alone to both ends of its band, with the gain recomputed: {dead}. {turned}"
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
            element("strong", "changes it") if row.flips else "no",
        )
        for row in band.rows
    ]
    heads = (
        "value",
        "confidence",
        "band",
        "deadband at low / high [mm]",
        "mode gap at low / high [mm]",
        "margin at low / high [sigma]",
        "verdict",
    )
    return table(heads, rows, label="Tolerance of the verdict", numeric=(2, 3, 4, 5), class_="wide")


def _unbanded(band: ToleranceBand) -> Html:
    if not band.unbanded:
        return Html("")
    names = ", ".join(band.unbanded)
    return element("p", f"No uncertainty band, therefore not tried: {names}.", class_="note")
