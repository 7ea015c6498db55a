"""Reading and writing design files.

A design file is TOML in UTF-8. The key `catalog_files` lists files with the user's own parts and materials.
`profile_csv` under `[indenter]` names a file with points of the tip's outline. `curve_csv` in a part's table names a
digitised curve. The content of all these files becomes part of the design, so a saved design needs no other file.

Files are written completely or not at all.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from optopad.design.errors import DesignError, shown
from optopad.design.file_sets import settle
from optopad.design.files import read_text, write_whole
from optopad.design.parts import catalog
from optopad.design.parts.spectrum import CURVE_FILE, CURVES, with_curve
from optopad.design.spec import SCHEMA_VERSION, SensorDesign
from optopad.design.spec.indenter import read_profile
from optopad.design.toml_text import explained, parsed_toml

MAX_FILE_BYTES = 1_000_000
NEEDED = (
    "a design or another file in TOML; `optopad new my-pad.toml --preset piacenza2017-pad` makes a design"
)
CATALOG_FILES = "catalog_files"
PROFILE_FILE = "profile_csv"


def load_design(path: str | os.PathLike[str]) -> SensorDesign:
    """Read and validate a design file.

    Raises
    ------
    DesignError : the file is not readable as TOML, has another schema version, or has invalid fields.
    """
    file = Path(path)
    settle(file.parent)
    document = read_toml(file)
    check_version(document, file)
    document = _with_own_profile(_with_own_catalog(_with_curves(document, "catalog", file), file), file)
    return SensorDesign.from_document(document, where=str(file))


def save_design(design: SensorDesign, path: str | os.PathLike[str]) -> None:
    """Write a design file completely or not at all; loading it gives a design with the same digest."""
    write_text_atomically(Path(path), dump_design(design))


def dump_design(design: SensorDesign) -> str:
    """A design as TOML text with every effective value; fields that are None or empty are left out."""
    document = without_empty(design.model_dump(mode="json"))
    heading = f"# optopad design {design.name}, digest {design.digest}\n"
    return heading + tomlkit.dumps(document)


def read_toml(file: Path) -> dict[str, Any]:
    """Parse a TOML file.

    Raises
    ------
    DesignError : the file is missing, a folder, too large, not UTF-8 text, or not TOML.
    """
    text = read_design_text(file)
    try:
        return parsed_toml(text)
    except tomllib.TOMLDecodeError as err:
        raise DesignError(f"{file}: not valid TOML: {explained(str(err), text)}") from None
    except ValueError as err:
        raise DesignError(f"{file}: {err}") from None


def read_design_text(file: Path) -> str:
    """Text of a TOML file without parsing it; DesignError if the file is missing or is not UTF-8 text."""
    return read_text(file, needed=NEEDED, most_bytes=MAX_FILE_BYTES, error=DesignError)


def check_version(document: Mapping[str, Any], file: Path) -> None:
    """Raise an error with a remedy if a document does not have the current schema version.

    Raises
    ------
    DesignError : the version is missing, no version, or newer (remedy: update optopad).
    """
    version = document.get("schema_version")
    if version is None:
        raise DesignError(
            f"{file}: schema_version is missing; add `schema_version = {SCHEMA_VERSION}` at its top"
        )
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise DesignError(f"{file}: schema_version: {version!r} is no version; it is a whole number from 1")
    if version > SCHEMA_VERSION:
        raise DesignError(
            f"{file}: schema_version: {version} is newer than {SCHEMA_VERSION}, "
            "the newest that this optopad reads; update optopad"
        )


def write_text_atomically(file: Path, text: str) -> None:
    """Write UTF-8 text completely or not at all; errors are as in `optopad.design.files.whole_file`."""
    write_whole(file, text.encode())


def without_empty(document: Any) -> Any:
    """Nested data without None and empty tables, which TOML cannot express or does not need."""
    if isinstance(document, dict):
        kept = {key: without_empty(value) for key, value in document.items()}
        return {key: value for key, value in kept.items() if value is not None and value != {}}
    if isinstance(document, list):
        return [without_empty(item) for item in document]
    return document


def catalog_file_entries(file: Path) -> catalog.CatalogEntries:
    """Entries of a catalogue file; DesignError if it cannot be read or has invalid fields."""
    return catalog.parse_entries(_with_curves({"": read_toml(file)}, "", file)[""], where=str(file))


def _with_own_catalog(document: dict[str, Any], file: Path) -> dict[str, Any]:
    names = document.pop(CATALOG_FILES, [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise DesignError(f"{file}: {CATALOG_FILES}: {names!r} is refused: give a list of file names")
    if not names:
        return document
    own = catalog.CatalogEntries()
    for name in names:
        beside = _beside(file, name, CATALOG_FILES)
        more = catalog_file_entries(beside)
        for kind in catalog.CatalogEntries.model_fields:
            doubled = sorted(set(getattr(own, kind)) & set(getattr(more, kind)))
            if doubled:
                raise DesignError(
                    f"{beside}: {kind}.{doubled[0]}: is in another of {CATALOG_FILES}, too; keep one of the two"
                )
        own = catalog.merged(own, more)
    given = document.get("catalog", {})
    if given:
        own = catalog.merged(own, catalog.parse_entries(given, where=f"{file}: catalog"))
    return document | {"catalog": own.model_dump(mode="json")}


def _with_curves(document: dict[str, Any], name: str, file: Path) -> dict[str, Any]:
    """Replace the names of curve files in catalogue `name` with the points in these files; return the document."""
    entries = document.get(name)
    parts = entries.get("parts") if isinstance(entries, dict) else None
    for part_id, part in parts.items() if isinstance(parts, dict) else ():
        for kind in CURVES if isinstance(part, dict) else ():
            table = part.get(kind)
            if isinstance(table, dict) and CURVE_FILE in table:
                key = ".".join(filter(None, (name, "parts", part_id, kind, CURVE_FILE)))
                part[kind] = with_curve(table, _named_beside(file, table[CURVE_FILE], key), kind)
    return document


def _with_own_profile(document: dict[str, Any], file: Path) -> dict[str, Any]:
    indenter = document.get("indenter")
    if not isinstance(indenter, dict) or PROFILE_FILE not in indenter:
        return document
    key, name = f"indenter.{PROFILE_FILE}", indenter[PROFILE_FILE]
    if "profile_mm" in indenter:
        raise DesignError(f"{file}: {key}: is given together with indenter.profile_mm; keep one of the two")
    given = {field: value for field, value in indenter.items() if field != PROFILE_FILE}
    return document | {"indenter": given | {"profile_mm": read_profile(_named_beside(file, name, key))}}


def _named_beside(file: Path, name: object, key: str) -> Path:
    if not isinstance(name, str):
        raise DesignError(f"{file}: {key}: {name!r} is refused: give the name of a file, in quotes")
    return _beside(file, name, key)


def _beside(file: Path, name: str, key: str) -> Path:
    folder = file.parent.resolve()
    try:
        target = (folder / name).resolve()
        is_file = target.is_file()
    except (ValueError, RuntimeError) as err:  # null byte in the name, or a loop of symbolic links
        raise DesignError(f"{file}: {key}: {shown(name)} is no name of a file: {err}") from None
    except OSError as err:  # name too long, or folder without access
        raise DesignError(f"{file}: {key}: {shown(name)}: {err.strerror}; correct the name") from None
    if not target.is_relative_to(folder):
        raise DesignError(
            f"{file}: {key}: {shown(name)} leaves the design's folder; put the file next to the design"
        )
    if not is_file:
        way_out = "correct its name or remove it"
        if "\\" in name or not name.isprintable():
            way_out = (
                "write / between folders, because \\ in double quotes starts an escape such as \\t for a tab"
            )
        raise DesignError(f"{file}: {key}: {shown(name)} is no file next to the design; {way_out}")
    return target


def file_schema() -> dict[str, Any]:
    """JSON Schema of a design file: the schema of the specification, plus the keys that refer to other files."""
    schema = SensorDesign.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["properties"][CATALOG_FILES] = {
        "type": "array",
        "items": {"type": "string"},
        "description": "files next to the design that define your own parts and materials",
    }
    schema["$defs"]["Indenter"]["properties"][PROFILE_FILE] = {
        "type": "string",
        "description": "file next to the design that holds the points of profile_mm, one per row",
    }
    for kind, lists in (("AngularTable", CURVES["angular_pattern"]), ("Spectrum", CURVES["spectrum"])):
        table = schema["$defs"][kind]
        table["required"] = [name for name in table["required"] if name not in lists]
        table["properties"][CURVE_FILE] = {
            "type": "string",
            "description": (
                f"file next to this one with {' and '.join(lists)}, one point per row, as a digitiser writes it"
            ),
        }
    return schema
