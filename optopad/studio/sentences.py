"""Texts of the panel as HTML: verdict with its assumptions, errors, pinned designs, sensor."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, pair_name
from optopad.fabrication.sheets.template import filled
from optopad.screen.figures import figures_of
from optopad.screen.output import STAGE_TITLES
from optopad.screen.verdict_sentences import sentences_of, verdict_words
from optopad.sims.verdict.depth_curve import DEADBAND_THRESHOLD
from optopad.studio.live import LiveView
from optopad.studio.session import Said, Version
from optopad.studio.workshop import LiveVerdict, Look, Progress


def verdict_html(now: Version, judged: LiveVerdict | None, failed: str, progress: Progress | None) -> str:
    """The verdict on the present design, or the reason why there is none, and the progress of running work."""
    is_old = judged is not None and judged.digest != now.design.digest
    shown = None if judged is None or (is_old and failed) else judged
    stage = "" if progress is None else STAGE_TITLES.get(progress.stage, progress.stage)
    return _html(
        "verdict",
        errors=[str(one) for one in now.errors],
        old_words=verdict_words(shown.score) if shown is not None and is_old else "",
        said=None if shown is None or is_old else sentences_of(now.design, shown.score),
        level="" if shown is None else shown.level,
        is_contiguous=shown is not None and shown.score.verdict == "CONTIGUOUS",
        failed=failed,
        stage=stage,
        share=0.0 if progress is None else progress.share,
    )


def said_html(said: Said, *, words: str, is_saved: bool) -> str:
    """The last message to the user, and whether the design is saved."""
    return _html("said", text=said.text or words, is_bad=said.is_bad, is_saved=is_saved)


def curves_title(
    place_mm: tuple[float, float], *, is_draft: bool, force_n: float | None, depth_mm: float, is_old: bool
) -> str:
    """Title of the signal curves: location, accuracy (draft or score), and load of the present press."""
    how = "draft: coarse light" if is_draft else "as optopad score"
    return _html(
        "curves",
        place_mm=place_mm,
        how="of the design before" if is_old else how,
        force_n=force_n,
        depth_mm=depth_mm,
    )


def held_html(look: Look, changes: FloatArray, cavity: CavityGeometry) -> str:
    """Title of the readings under an object or two tips: location, load and changed pairs.

    `changes` are those of the readings, (emitter, receiver) [noise units].
    """
    held, tips = look.press.held, look.press.tips_mm
    most = np.unravel_index(int(np.abs(changes).argmax()), changes.shape)
    return _html(
        "held",
        words="" if held is None else held.words,
        tips=list(zip(tips, look.tips_n, strict=False)),
        apart_mm=math.dist(*(tip[:2] for tip in tips)) if len(tips) > 1 else 0.0,
        press=look.press,
        look=look,
        changed=int((np.abs(changes) > DEADBAND_THRESHOLD).sum()),
        pairs=changes.size,
        least=DEADBAND_THRESHOLD,
        most=pair_name(cavity, (int(most[0]), int(most[1]))),
        largest=float(changes[most]),
    )


def pins_html(pinned: Sequence[Version], now: Version, found: Mapping[str, LiveVerdict]) -> str:
    """Table of the figures of pinned designs and of the present design, one column each."""
    if not pinned:
        return ""
    heads, columns, titles = [], [], list[str]()
    for name, version in [*((f"pin {k + 1}", one) for k, one in enumerate(pinned)), ("now", now)]:
        judged, design = found.get(version.design.digest), version.design
        if judged is None and version.errors:
            continue
        is_draft = judged is not None and judged.level == "draft"
        heads.append((f"{name}, draft" if is_draft else name, version.words))
        cells = (figures_of(design, None) if judged is None else judged.figures(design)).cells
        columns.append([cell.text if judged or cell.text not in ("", "-") else "…" for cell in cells])
        titles = [cell.title for cell in cells]
    return _html("pins", heads=heads, rows=list(zip(titles, *columns, strict=True)))


def sensor_html(view: LiveView) -> str:
    """State of the connection, the estimated touch, and the findings of the wiring check."""
    return _html("sensor", view=view)


def _html(template: str, **values: object) -> str:
    return filled("optopad.studio", f"{template}.html.j2", values)


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
