"""Pages that are made from the program: every verb with its options, every field with its meaning."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from docstring_sections import with_lists

from design.fields.base import known_values
from design.preset import PRESETS, preset
from design.spec import SensorDesign
from optopad.cli.commands import whole_command
from tests.docs import reference_pages
from tests.docs.command_text import every_verb
from tests.docs.field_text import MEANINGS, QUANTITY, Field, design_schema, every_field, sections
from tests.docs.preset_table import preset_picture
from tests.docs.reference_pages import FOLDER, MADE, PAGES, PICTURES, page_text
from tests.said import says


def leaves(group: Any, before: str = "optopad") -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, f"{before} {name}")
        else:
            yield f"{before} {name}", command


def parts_of(text: str) -> dict[str, str]:
    """What stands under each heading."""
    pieces = re.split(r"^## (.*)$", text, flags=re.MULTILINE)[1:]
    return dict(zip(pieces[::2], pieces[1::2], strict=True))


def all_fields() -> list[Field]:
    return [field for _, _, fields in sections(design_schema()) for field in fields]


def test_every_verb_has_a_heading() -> None:
    verbs = [name for name, command in leaves(whole_command()) if not command.hidden]
    assert list(parts_of(every_verb())) == verbs
    assert {"optopad run", "optopad driver collect", "optopad contact show"} <= set(verbs)


def test_every_option_of_every_verb_stands_under_it_with_its_help() -> None:
    parts = parts_of(every_verb())
    for name, command in leaves(whole_command()):
        for one in command.params:
            if one.param_type_name == "option" and not one.hidden and "--help" not in one.opts:
                row = next((line for line in parts[name].splitlines() if f"| `{one.opts[-1]}" in line), None)
                assert row is not None, (name, one.opts)
                assert row.count("|") - row.count("\\|") == 4, row
                assert len(row.split("|")[2].strip()) > 3, f"{name} {one.opts[-1]} has no help"


def test_an_option_has_default_and_limits() -> None:
    part = parts_of(every_verb())["optopad driver collect"]
    assert says(part, "S` | ... Waiting ... At least ... 0.0. | ... `0.3` |")
    assert re.search(r"^\| `--out FILE` \|.*\| needed \|$", part, flags=re.MULTILINE)


def test_every_name_of_the_schema_stands_in_the_tables() -> None:
    schema = design_schema()
    tables = [
        schema,
        *(one for one in schema["$defs"].values() if one["title"] not in (QUANTITY, "CatalogEntries")),
    ]
    shown = {field.path.rpartition(".")[2] for field in all_fields()}
    groups = {
        "cavity",
        "mold",
        "elastomer",
        "surfaces",
        "layout",
        "indenter",
        "board",
    }
    groups |= {"noise", "gain", "operating", "catalog", "crown"}
    assert {name for table in tables for name in table.get("properties", {})} - shown == groups


def test_a_value_that_set_takes_has_its_path_on_the_page() -> None:
    paths = {re.sub(r"\.\d+\.", ".N.", path) for path in known_values(SensorDesign)}
    shown = {field.path for field in all_fields()} | {f"catalog.{field.path}" for field in all_fields()}
    plain = {path for path in paths if not re.search(r"[<{*\[]", path)}
    assert {path for path in plain if not path.startswith(("catalog", "layout"))} - shown == set()


def test_every_field_has_a_meaning_and_no_meaning_is_left_over() -> None:
    fields = all_fields()
    assert [field.path for field in fields if not field.meaning] == []
    assert set(MEANINGS) - {field.path for field in fields} == set()


def test_a_field_has_unit_range_default_and_meaning() -> None:
    found = {field.path: field for field in all_fields()}
    assert found["cavity.clear_thickness_mm"] == Field(
        "cavity.clear_thickness_mm",
        "mm",
        "1 to 50",
        "needed",
        "clear layer that light uses, at its highest point",
    )
    assert (found["board.settle_us"].unit, found["board.settle_us"].default) == ("µs", "`20.0`")
    assert found["surfaces.wall_finish"].allowed == '`"diffuse"`, `"glossy"`, `"air_gap"`'


def test_defaults_of_the_page_are_those_of_a_design() -> None:
    document = preset("piacenza2017-pad").model_dump(mode="json")
    defaults = {field.path: field.default for field in all_fields()}
    assert defaults["operating.workspace_margin_mm"] == f"`{document['operating']['workspace_margin_mm']}`"


def test_a_table_row_has_five_cells() -> None:
    rows = [line for line in every_field().splitlines() if line.startswith("|")]
    assert {line.replace("\\|", "").count("|") for line in rows} == {6}


@pytest.mark.parametrize("name", PAGES)
def test_the_page_in_the_repository_is_current(name: str) -> None:
    is_current = (FOLDER / name).read_text(encoding="utf-8") == page_text(name)
    assert is_current, f"docs/reference/{name} is out of date; renew it: python -m tests.docs.reference_pages"


def test_the_pictures_of_the_presets_are_current() -> None:
    shown = {path.stem: path.read_text(encoding="utf-8") for path in PICTURES.iterdir()}
    assert shown == {name: preset_picture(preset(name)) for name in PRESETS}, "renew them as the pages"


def test_a_page_without_its_line_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "commands.md").write_text("# Commands", encoding="utf-8")
    monkeypatch.setattr(reference_pages, "FOLDER", tmp_path)
    with pytest.raises(ValueError, match="has no line"):
        page_text("commands.md")
    (tmp_path / "commands.md").write_text(f"# Commands\n\n{MADE}\n\nold", encoding="utf-8")
    assert page_text("commands.md").startswith(f"# Commands\n\n{MADE}\n\n## optopad ")


def test_a_docstring_s_sections_become_lists() -> None:
    said = [
        "Press.",
        "",
        "Parameters",
        "----------",
        "x_mm, y_mm : (n,) place",
        "    in plan [mm]",
        "depth : how deep",
    ]
    assert [line for line in with_lists(said) if line] == [
        "Press.",
        ":Parameters:",
        "    **x_mm**, **y_mm**",
        "        (n,) place",
        "        in plan [mm]",
        "    **depth**",
        "        how deep",
    ]


def test_a_section_without_names_stays_text() -> None:
    said = ["Sum.", "", "Returns", "-------", "(n,) sum of both [-]"]
    assert [line for line in with_lists(said) if line] == ["Sum.", ":Returns:", "    (n,) sum of both [-]"]
    assert with_lists(["Only text."]) == ["Only text."]
