"""Texts of the panel as HTML: verdict with its assumptions, errors, pinned designs, sensor."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape

from optopad.design.shape.cavity import PlacedPart
from optopad.screen.figures import figures_of
from optopad.screen.stages import STAGE_TITLES
from optopad.screen.verdict_sentences import sentences_of, verdict_words
from optopad.studio.live import LiveView
from optopad.studio.live_results import LiveVerdict, Progress
from optopad.studio.session import Said, Version

RED, GREEN, AMBER, GREY = "#d1242f", "#1a7f37", "#9a6700", "#6e7781"
LEVELS = {
    "draft": (AMBER, "draft", "coarse light; the score follows"),
    "score": ("#0969da", "score", "as optopad score; unmeasured parameters are being tried"),
    "whole": (GREEN, "score", "as optopad score, with the unmeasured parameters"),
}


def verdict_html(now: Version, judged: LiveVerdict | None, failed: str, progress: Progress | None) -> str:
    """The verdict on the present design, or the reason why there is none, and the progress of running work."""
    parts = [errors_html(now)] if now.errors else []
    if not now.errors:
        if judged is not None and (judged.digest == now.design.digest or not failed):
            parts.append(_judged(now, judged))
            parts += [_line(f"of this press: {failed}", RED)] if failed else []
        elif failed:
            parts.append(_block(RED, "no result", [failed]))
        else:
            parts.append(_line("computing the first result", GREY))
    if progress is not None and progress.stage:
        title = STAGE_TITLES.get(progress.stage, progress.stage)
        parts.append(_line(f"{title}: {progress.share:.0%}", GREY))
    return _wrapped("".join(parts))


def _judged(now: Version, judged: LiveVerdict) -> str:
    colour, badge, tells = LEVELS[judged.level]
    is_old = judged.digest != now.design.digest
    said = sentences_of(now.design, judged.score) if not is_old else None
    if said is None:
        words = [f"of the design before: {verdict_words(judged.score)}"]
        return _block(GREY, "updating", words)
    head = said.verdict
    words = [_label("cause", said.why), _label("margin", said.margin), _label("fix", said.fix)]
    if judged.level != "draft":
        words.append(_label("confidence", said.confidence))
    words.append(_label("resolution", said.resolution))
    good = GREEN if judged.score.verdict == "CONTIGUOUS" else RED
    body = "".join(f'<div style="margin-top:3px">{text}</div>' for text in words if text)
    mark = (
        f'<span title="{escape(tells, quote=True)}" style="float:right;color:{colour};border:1px solid {colour};'
        f'border-radius:6px;padding:0 6px;font-size:11px">{badge}</span>'
    )
    return (
        f'<div style="border-left:4px solid {good};padding:2px 0 2px 8px">{mark}'
        f'<b class="verdict">{escape(head)}</b>{body}</div>'
    )


def errors_html(now: Version) -> str:
    """The errors of a design, with the texts of `optopad check`."""
    count = len(now.errors)
    title = f"does not fit: {count} error{'s' if count > 1 else ''}; nothing is judged or saved"
    return _block(RED, title, [str(one) for one in now.errors[:6]])


def said_html(said: Said, *, words: str, is_saved: bool) -> str:
    """The last message to the user, and whether the design is saved."""
    state = "saved" if is_saved else "not saved"
    text = said.text or words
    colour = RED if said.is_bad else "inherit"
    return _wrapped(
        f'<div style="font-size:12px"><span style="float:right;color:{GREY}">{state}</span>'
        f'<span class="said" style="color:{colour}">{escape(text)}</span></div>'
    )


def curves_title(
    place_mm: tuple[float, float], *, is_draft: bool, force_n: float | None, depth_mm: float, is_old: bool
) -> str:
    """Title of the signal curves: location, accuracy (draft or score), and load of the present press."""
    how = "draft: coarse light" if is_draft else "as optopad score"
    how = "of the design before" if is_old else how
    load = "" if force_n is None else f"; at {depth_mm:.2f} mm {force_n:.2f} N"
    return _wrapped(
        f'<div style="font-size:12px"><b>Pairs under the tip</b> at x {place_mm[0]:.1f}, y {place_mm[1]:.1f} mm{load} '
        f'<span style="color:{GREY}">({how})</span></div>'
    )


def pins_html(pinned: Sequence[Version], now: Version, found: Mapping[str, LiveVerdict]) -> str:
    """Table of the figures of pinned designs and of the present design, one column each."""
    if not pinned:
        return ""
    heads, columns, titles = [_head("", "")], [], list[str]()
    for name, version in [*((f"pin {k + 1}", one) for k, one in enumerate(pinned)), ("now", now)]:
        judged, design = found.get(version.design.digest), version.design
        if judged is None and version.errors:
            continue
        is_draft = judged is not None and judged.level == "draft"
        heads.append(_head(f"{name}, draft" if is_draft else name, version.words))
        cells = (figures_of(design, None) if judged is None else judged.figures(design)).cells
        columns.append([cell.text if judged or cell.text not in ("", "-") else "…" for cell in cells])
        titles = [cell.title for cell in cells]
    rows = zip(titles, *columns, strict=True)
    lines = ["".join(heads), *("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)]
    table = (
        f"<table style='width:100%;font-size:11px'>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"
    )
    return _wrapped(f'<div style="font-size:12px"><b>Pinned</b></div>{table}')


def sensor_html(view: LiveView) -> str:
    """State of the connection, the estimated touch, and the findings of the wiring check."""
    colour = GREEN if view.is_reading else RED
    counts = f"{view.frames} frames, {view.lost} lost, {view.damaged} damaged"
    more = f", {view.reconnects} reconnects" if view.reconnects else ""
    lines = [
        f'<span style="color:{colour}">●</span> {escape(view.status)}',
        escape(counts + more),
    ]
    if view.touch is not None:
        drift = view.touch.drift
        lines.append(escape(str(view.touch)))
        lines.append(f"drift {drift.drift:+.2%}{', held' if drift.is_held else ', followed'}")
    for problem in view.problems:
        tint = RED if problem.is_error else AMBER
        lines.append(f'<span style="color:{tint}">{escape(problem.kind)}: {escape(problem.message)}</span>')
    return _wrapped("".join(f'<div style="font-size:12px">{line}</div>' for line in lines))


def bad_parts(now: Version, parts: Sequence[PlacedPart]) -> tuple[str, ...]:
    """Names of the components that an error concerns.

    They are found by their layout entry, by the field of their height, or by their name in the error's text.
    """
    found: list[str] = []
    fields = {one.field for one in now.errors}
    words = " ".join(f"{one.message} {one.value}" for one in now.errors)
    named = set(re.findall(r"[A-Za-z][A-Za-z0-9_-]*", words))
    for part in parts:
        if (
            part.height_field in fields
            or part.name in named
            or any(one.startswith(f"{part.origin}.") for one in fields)
        ):
            found.append(part.name)
    return tuple(found)


def _head(text: str, title: str) -> str:
    return f"<th style='text-align:left' title='{escape(title, quote=True)}'>{escape(text)}</th>"


def _label(name: str, text: str) -> str:
    return f'<span style="color:{GREY}">{name}</span> {escape(text)}' if text else ""


def _block(colour: str, title: str, lines: Sequence[str]) -> str:
    body = "".join(f'<div style="margin-top:3px">{escape(line)}</div>' for line in lines)
    return (
        f'<div style="border-left:4px solid {colour};padding:2px 0 2px 8px"><b style="color:{colour}">'
        f"{escape(title)}</b>{body}</div>"
    )


def _line(text: str, colour: str) -> str:
    return f'<div style="color:{colour};font-size:12px;margin-top:4px">{escape(text)}</div>'


def _wrapped(body: str) -> str:
    return f'<div style="padding:4px 10px;font-size:13px;line-height:1.35">{body}</div>'
