"""The verdict at the top of the page: sentences, what it depends on, and the figures that one chooses a design by."""

from __future__ import annotations

from markupsafe import Markup

from optopad.design.spec import SensorDesign
from optopad.report.words import part
from optopad.screen.figures import figures_of
from optopad.screen.verdict_sentences import no_fix_words, sentences_of
from optopad.sims.score.result import ContinuityScore


def verdict_part(design: SensorDesign, score: ContinuityScore) -> Markup:
    """The verdict as a box with the sentences that the terminal shows, and figures as on its screens."""
    said = sentences_of(design, score)
    margin, resolution = (
        f"{label}: {text}" if text else ""
        for label, text in (("margin", said.margin), ("resolution", said.resolution))
    )
    after = said.verdict.removeprefix(score.verdict).lstrip(":, ")
    more = (said.why, no_fix_words(score.trial), said.fix, margin, said.confidence, resolution)
    return part(
        "verdict",
        score=score,
        sentences=[_sentence(after), *(_sentence(text) for text in more if text)],
        figures=[] if score.strength is None else figures_of(design, score).cells,
    )


def _sentence(text: str) -> str:
    """The text as a sentence: with a full stop, and with a capital unless it begins with a field's path."""
    is_path = "." in text.split(" ", 1)[0]
    return f"{text if is_path else text[:1].upper() + text[1:]}."
