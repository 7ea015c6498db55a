"""Templates: what is escaped, what is refused, and that no template names a filter or file that is missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from jinja2 import UndefinedError
from markupsafe import Markup

from optopad.fabrication.sheets.template import filled, templates

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "optopad.fabrication.sheets": "fabrication/sheets",
    "optopad.report": "optopad/report",
    "optopad.studio": "optopad/studio",
}
ATTACK = "<script>alert(1)</script> & \"double\" 'single' {{ 7 * 7 }}"


def table(cell: str) -> str:
    values = {"heads": [Markup("a"), Markup("b")], "rows": [["x", cell]], "numeric": []}
    return filled("optopad.report", "sheet_table.html.j2", values)


def test_html_escapes_text_once_and_leaves_markup_alone() -> None:
    said = table(ATTACK)
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &#34;double&#34; &#39;single&#39; {{ 7 * 7 }}" in said
    assert "<b>a &amp; b</b>" in table(Markup("<b>a &amp; b</b>"))


def test_a_name_without_a_value_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="heads"):
        filled("optopad.report", "sheet_table.html.j2", {})


def test_data_of_a_page_cannot_end_their_element_and_stay_what_they_are() -> None:
    data = templates("optopad.report").filters["data"]
    text = data({"label": ATTACK})
    assert "<" not in text
    assert json.loads(text) == {"label": ATTACK}
    with pytest.raises(ValueError, match="JSON"):
        data(float("nan"))


@pytest.mark.parametrize("package", PACKAGES)
def test_every_template_compiles(package: str) -> None:
    names = {path.name for path in (ROOT / PACKAGES[package] / "templates").iterdir()}
    found = templates(package)
    assert set(found.list_templates()) == names
    assert [name for name in names if found.get_template(name).name != name] == []
