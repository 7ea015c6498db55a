"""The prose of README and docs: short sentences in the field's own words."""

import re
from pathlib import Path

import pytest

from tests.docs.prose import sentences, without_code, words_in

ROOT = Path(__file__).parents[2]
OF_THE_PROGRAM = ("commands.md", "design-fields.md")
"""Pages whose words are those of help texts and fields."""
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name not in OF_THE_PROGRAM),
]
LONG = 30
"""Words of a sentence that is too long; 5 % of all sentences may be."""
SHARE = 0.95

WORDS = {
    r"tell|tells|told|telling": "resolve, distinguish, estimate; report (of programs)",
    r"felt|feel|feels": "detected, detection threshold",
    r"blind": "deadband where the signal comes back below; otherwise not resolved",
    r"faded|fades|fade|used up|spent": "saturated; the signal no longer changes",
    r"worth": "resolution; or leave it out",
    r"sure|surer|surest": "confident, certain",
    r"heed|heeds|heeded": "warning",
    r"weakest": "least, margin",
    r"open value|open values|open optical values": "unmeasured parameter",
    r"turns? the verdict|may turn": "changes the verdict",
    r"mend|mends|mended|mending": "fix, improve",
    r"errand|errands|doing|knob|knobs|wish|wishes|wished": "task, running job, editable field, request",
    r"beside|besides": "next to, compared with, in addition to",
    r"nobody has|nobody told|nobody knows": "unmeasured, not known",
    r"to be had|be had|of its own accord": "a plain verb",
}
"""Words that are not used, as patterns, and what to write instead."""


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def found_in(text: str) -> list[str]:
    """Words of the list with their line and what to write instead."""
    lines = without_code(text).splitlines()
    return [
        f"line {number}: {found.group()!r}; write {instead}: {line.strip()}"
        for number, line in enumerate(lines, start=1)
        for pattern, instead in WORDS.items()
        for found in re.finditer(rf"\b(?:{pattern})\b", line, flags=re.IGNORECASE)
    ]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_a_page_uses_no_word_of_the_list(page: Path) -> None:
    assert found_in(page.read_text(encoding="utf-8")) == []


def test_words_of_the_list_are_found_in_text_and_not_in_code() -> None:
    assert len(found_in("The sensor is blind.\nIt `tells` and told.")) == 2
    assert found_in("```\nblind\n```\nIndeed, a spectrum.") == []


def test_nearly_all_sentences_are_short() -> None:
    every = [(name_of(page), one) for page in PAGES for one in sentences(page.read_text(encoding="utf-8"))]
    long = [f"{page}: {words_in(one)} words: {one}" for page, one in every if words_in(one) >= LONG]
    assert len(every) > 1000
    assert 1 - len(long) / len(every) >= SHARE, "\n".join(long)


def test_sentences_end_at_full_stops_and_at_list_items() -> None:
    page = "# Title\n\nOne [is](x.md) here. Two `a.b` is\nthere.\n\n- Three of 0.3 mm is so\n- Four is.\n\n| a | b |\n"
    assert [*sentences(page)] == [
        "One is here.",
        "Two code is there.",
        "- Three of 0.3 mm is so",
        "- Four is.",
    ]
    assert words_in("Three of 0.3 mm is so") == 5
