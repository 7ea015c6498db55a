"""Numbers of README and docs: each quoted figure is what its stored result says, and measured numbers are quoted.

A number with a unit is quoted (`0.083<!--light.pad.rms--> %`), or in a block that a command makes, or in the reviewed
list `reviewed_numbers.txt`: sizes of designs, settings, limits, figures of the paper and of other sources.
"""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from optopad.design.circuit.circuit import Circuit
from optopad.design.preset import preset
from tests.validation.figures import PAGE, QUOTED, figures, page_text, quoted_anew, quoting
from tests.validation.summaries import SUMMARIES, with_summaries

ROOT = Path(__file__).parents[2]
RENEW = "python -m tests.validation.figures"
REVIEWED = Path(__file__).with_name("reviewed_numbers.txt")
MADE_WHOLE = (
    "contact-interpolation",
    "figures",
    "firmware",
    "learning",
    "link",
    "memory",
    "search",
    "slip",
    "thickness",
    "touch",
)
"""Pages of docs/validation that a command writes, text and all."""
CHECKED = [
    ROOT / "README.md",
    *(page for page in sorted((ROOT / "docs" / "validation").glob("*.md")) if page.stem not in MADE_WHOLE),
]
FENCE = re.compile(r"^( *)(`{3,}|:{3,})[^\n]*\n.*?^\1\2\s*$", flags=re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"<!--.*?-->", flags=re.DOTALL)
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
MADE = re.compile(r"<!-- made by .*?<!-- end.*?-->", flags=re.DOTALL)
UNITS = r"%|mm|µm|N|s|ms|Hz|MPa|V|GB|counts?|times|sigma|noise units|joint standard errors|core-s(?:econds)?"
ONE = r"[-+±]*\d[\d,]*(?:\.\d+)?(?:<!--[a-z][\w.-]*-->)?"
CHAIN = re.compile(rf"(?<![\w.]){ONE}(?:(?:,? (?:to|and|or|x|±)|,)? ?{ONE})*\s*(?:{UNITS})(?![\w/²³])")


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def typed_by_hand(text: str) -> list[str]:
    """Numbers with a unit that are neither quoted nor made by a command, as one line each."""
    text = MADE.sub("", text)
    text = FENCE.sub("", text)
    text = LINK.sub(r"\1", re.sub(r"`[^`]+`", "code", text))
    found = []
    for chain in CHAIN.finditer(text):
        plain = QUOTED.sub("", chain.group())
        if re.search(r"\d", plain):
            found.append(" ".join(COMMENT.sub("", chain.group()).split()))
    return found


def reviewed() -> dict[str, set[str]]:
    """Page and its reviewed numbers; a line in brackets names a page, a line with # says where its numbers are from."""
    found: dict[str, set[str]] = {}
    page = ""
    for line in REVIEWED.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            page = line.strip("[]")
        elif line.strip() and not line.startswith("#"):
            found.setdefault(page, set()).update(one.strip() for one in line.split("|"))
    return found


def test_the_page_of_figures_is_what_the_stored_results_say() -> None:
    is_current = PAGE.read_text(encoding="utf-8") == page_text("")
    assert is_current, f"{name_of(PAGE)} is out of date; renew it: {RENEW}"


@pytest.mark.parametrize("name", SUMMARIES)
def test_a_summary_is_what_the_stored_table_says(name: str) -> None:
    is_current = (ROOT / name).read_text(encoding="utf-8") == with_summaries(name)
    assert is_current, f"{name} is out of date; renew it: {RENEW}"


@pytest.mark.parametrize("page", quoting(), ids=name_of)
def test_a_quoted_number_is_its_figure(page: Path) -> None:
    values = {one.name: one.value for one in figures()}
    text = page.read_text(encoding="utf-8")
    names = [found["name"] for found in QUOTED.finditer(text)]
    assert set(names) - set(values) == set()
    assert [*QUOTED.finditer(text)] == [] or text == quoted_anew(text, values), (
        f"{name_of(page)}: renew: {RENEW}"
    )


def test_every_figure_is_quoted_somewhere() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in quoting())
    assert {one.name for one in figures()} - {found["name"] for found in QUOTED.finditer(text)} == set()


@pytest.mark.parametrize("page", CHECKED, ids=name_of)
def test_no_measured_number_is_typed_by_hand(page: Path) -> None:
    typed = set(typed_by_hand(page.read_text(encoding="utf-8")))
    assert typed - reviewed().get(name_of(page), set()) == set(), (
        f"quote a figure ({RENEW}), or review the number in {name_of(REVIEWED)}"
    )


def test_no_reviewed_number_is_left_over() -> None:
    there = {name_of(page): set(typed_by_hand(page.read_text(encoding="utf-8"))) for page in CHECKED}
    assert {page: left for page, found in reviewed().items() if (left := found - there[page])} == {}


def test_frame_rates_are_those_of_the_timing_model() -> None:
    page = (ROOT / "docs" / "how-to" / "on-a-gripper.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \+ (\d+) \| (\d+) \| (\d+) \|", page, flags=re.MULTILINE)
    assert len(rows) == 5
    design = preset("gripper-stadium")
    for emitters, receivers, *said in rows:
        for prescaler, rate in zip((64, 128), said, strict=True):
            circuit = Circuit.of(design).with_use(adc_prescaler=prescaler)
            took = replace(circuit, emitter_count=int(emitters), receiver_count=int(receivers)).frame_ms
            assert int(1000 / took) == int(rate) or round(1000 / took) == int(rate)
