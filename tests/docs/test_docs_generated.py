"""Pages that are made from the program: every verb with its options, every field with its meaning."""

import re

import pytest

from optopad.design.fields.base import known_values
from optopad.design.preset import PRESETS, preset
from optopad.design.spec import SensorDesign
from tests.docs.field_text import Field, design_schema, sections
from tests.docs.preset_table import preset_picture
from tests.docs.reference_pages import FOLDER, PAGES, PICTURES, page_text


def all_fields() -> list[Field]:
    return [field for _, _, fields in sections(design_schema()) for field in fields]


def test_a_value_that_set_takes_has_its_path_on_the_page() -> None:
    paths = {re.sub(r"\.\d+\.", ".N.", path) for path in known_values(SensorDesign)}
    shown = {field.path for field in all_fields()} | {f"catalog.{field.path}" for field in all_fields()}
    plain = {path for path in paths if not re.search(r"[<{*\[]", path)}
    assert {path for path in plain if not path.startswith(("catalog", "layout"))} - shown == set()


def test_every_field_has_a_meaning() -> None:
    assert [field.path for field in all_fields() if not field.meaning] == []


@pytest.mark.parametrize("name", PAGES)
def test_the_page_in_the_repository_is_current(name: str) -> None:
    is_current = (FOLDER / name).read_text(encoding="utf-8") == page_text(name)
    assert is_current, f"docs/reference/{name} is out of date; renew it: python -m tests.docs.reference_pages"


def test_the_pictures_of_the_presets_are_current() -> None:
    shown = {path.stem: path.read_text(encoding="utf-8") for path in PICTURES.iterdir()}
    assert shown == {name: preset_picture(preset(name)) for name in PRESETS}, "renew them as the pages"
