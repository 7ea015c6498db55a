"""A design by a word: a file, a bundle or a preset, with changes on top."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from design.errors import InputError
from design.toml_text import parsed_toml

if TYPE_CHECKING:
    from design.spec import SensorDesign


def read_design(where: str, changes: list[str] | None) -> SensorDesign:
    """Load a design file, a bundle's design, or a preset, and apply ``--set`` changes.

    Raises
    ------
    DesignError, InputError : what is wrong with the file or a change.
    """
    from design.fields.paths import nearest
    from design.io import load_design
    from design.preset import PRESETS, preset

    path = Path(where)
    if not path.exists() and where in PRESETS:
        design = preset(where)
    elif not path.exists() and not path.suffix:
        near = nearest(where, PRESETS)
        hint = f"did you mean {near[0]}?" if near else f"presets: {', '.join(PRESETS)}"
        raise InputError(f"{where}: no such file, bundle or preset; {hint}")
    else:
        design = load_design(path / "design.toml" if (path / "manifest.json").is_file() else path)
    return design.with_(**dict(parsed_change(change) for change in changes)) if changes else design


def parsed_change(text: str, *, option: str = "--set") -> tuple[str, Any]:
    """Path and value of one ``PATH=VALUE``; the value is read as TOML, else as plain text.

    Raises
    ------
    InputError : no ``=`` or no path.
    """
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"{option}: {text!r} is refused: write PATH=VALUE, as cavity.clear_thickness_mm=10")
    return path.strip(), parsed_value(value.strip())


def parsed_value(text: str) -> Any:
    """A value written as in a design file; bare words are text."""
    try:
        return parsed_toml(f"value = {text}")["value"]
    except ValueError:  # not TOML, a whole number of thousands of digits, nested too deep
        return text
