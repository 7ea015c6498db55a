"""Everything that is wrong with a design file is said in one message, in the user's words."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from optopad.design.errors import DesignError
from optopad.design.fields.validation import PATTERN_WORDS
from optopad.design.io import file_schema, load_design
from optopad.design.rules.check import check, require_valid
from tests.design.bad_designs import BAD_DESIGNS, FILE_NAME, design_text, put

JARGON = ("type=", "https://", "pydantic", "Traceback", "input_value", "validation error", "NoneType")


def test_the_design_that_all_bad_ones_vary_is_good(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text(design_text(), encoding="utf-8")
    assert [
        finding for finding in check(load_design(tmp_path / FILE_NAME)) if finding.severity == "error"
    ] == []


def refusal(path: Path) -> str:
    """What is said of a file; nothing of one that is good."""
    try:
        require_valid(load_design(path))
    except DesignError as err:
        return str(err)
    return ""


def test_a_bad_design_is_refused_in_the_users_words(tmp_path: Path) -> None:
    for number, bad in enumerate(BAD_DESIGNS):
        folder = tmp_path / str(number)
        folder.mkdir()
        path = put(bad, folder)
        before = sorted(folder.iterdir())
        message = refusal(path)
        assert message, f"{bad.id}: not refused"
        assert [word for word in JARGON if word in message] == [], bad.id
        assert len(message) < 4000, bad.id
        assert sorted(folder.iterdir()) == before, bad.id


def test_all_faults_of_a_file_are_named_at_once(tmp_path: Path) -> None:
    text = design_text({"cavity.length_mm": "-1.0", "name": '"a/b"', "emitters.part": None})
    (tmp_path / FILE_NAME).write_text(text, encoding="utf-8")
    with pytest.raises(DesignError) as caught:
        load_design(tmp_path / FILE_NAME)
    lines = str(caught.value).splitlines()
    assert len(lines) == 1 + 3
    assert [line.split(":")[0].strip() for line in lines[1:]] == [
        "name",
        "cavity.length_mm",
        "emitters.part",
    ]


@pytest.mark.parametrize("kind", ["emitter", "receiver"])
def test_a_part_in_a_wall_needs_a_height(tmp_path: Path, kind: str) -> None:
    (tmp_path / FILE_NAME).write_text(design_text({f"{kind}s.height_mm": None}), encoding="utf-8")
    with pytest.raises(
        DesignError,
        match=rf"{kind}s\.height_mm is missing: {kind[0].upper()}1 in the south wall needs it; add",
    ):
        load_design(tmp_path / FILE_NAME)


@pytest.mark.parametrize(
    ("given", "refusal"),
    [
        ('"x"', "layout.0.parts_per_side: 'x'"),
        ("2.5", "layout.0.parts_per_side: 2.5"),
        ("0", "layout.0.parts_per_side: 0"),
        ("[2, 2, 2, -4]", "layout.0.parts_per_side.3: -4"),
        ("[2, 2, 2]", "layout.0.parts_per_side.3: is missing; add it"),
    ],
)
def test_a_field_that_takes_a_value_or_a_list_is_refused_as_what_was_given(
    tmp_path: Path, given: str, refusal: str
) -> None:
    text = design_text(layout=f'[[layout]]\npattern = "alternating_ring"\nparts_per_side = {given}\n')
    (tmp_path / FILE_NAME).write_text(text, encoding="utf-8")
    with pytest.raises(DesignError) as caught:
        load_design(tmp_path / FILE_NAME)
    _, line = str(caught.value).splitlines()
    assert line.strip().startswith(refusal)


def test_a_long_list_of_faults_is_cut_and_counted(tmp_path: Path) -> None:
    layout = '[[layout]]\npattern = "facing_rows"\ncount = -1\n' * 30
    (tmp_path / FILE_NAME).write_text(design_text(layout=layout), encoding="utf-8")
    with pytest.raises(DesignError, match=r"\.\.\. and 10 more$"):
        load_design(tmp_path / FILE_NAME)


def patterns(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if isinstance(schema.get("pattern"), str):
            yield schema["pattern"]
        for inner in schema.values():
            yield from patterns(inner)
    elif isinstance(schema, list):
        for inner in schema:
            yield from patterns(inner)


def test_each_pattern_of_the_schema_has_words() -> None:
    assert set(patterns(file_schema())) <= set(PATTERN_WORDS)
