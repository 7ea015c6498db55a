"""Pydantic's findings as one message in the user's words: field, value, limit, way out."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from design.errors import DesignError

SHOWN_VALUE_CHARACTERS = 60
LISTED_FINDINGS = 20

_WAY_OUT = {
    "missing": "is missing; add it (see `optopad schema`, or start from `optopad new`)",
    "extra_forbidden": "is not a field of a design; remove it or correct its spelling (see `optopad schema`)",
    "union_tag_not_found": "lacks `pattern`; use one of alternating_ring, facing_rows, per_side, single",
}


def design_error(err: ValidationError, where: str) -> DesignError:
    """All findings of a validation as one error.

    Parameters
    ----------
    err : what pydantic found
    where : file or design that was being read
    """
    details = err.errors(include_url=False)
    lines = list(dict.fromkeys(_finding(detail) for detail in details))
    shown = lines[:LISTED_FINDINGS]
    if len(lines) > len(shown):
        shown.append(f"... and {len(lines) - len(shown)} more")
    return DesignError(f"{where}: not a usable design\n" + "\n".join(f"  {line}" for line in shown))


def field_path(detail: ErrorDetails) -> str:
    """Dotted path of a finding, without pydantic's own union and type markers."""
    keys = [str(key) for key in detail["loc"] if isinstance(key, int) or not _is_marker(str(key))]
    return ".".join(keys) or "the file"


def _is_marker(key: str) -> bool:
    return "[" in key or key in {
        "int",
        "float",
        "constrained-int",
        "alternating_ring",
        "facing_rows",
        "per_side",
        "single",
    }


def _finding(detail: ErrorDetails) -> str:
    field, kind = field_path(detail), detail["type"]
    if kind in _WAY_OUT:
        return f"{field}: {_WAY_OUT[kind]}"
    if kind == "value_error":  # raised by a rule of ours, which names its values itself
        return f"{field}: {detail['msg'].removeprefix('Value error, ')}".removeprefix("the file: ")
    return f"{field}: {_shown(detail['input'])} is refused: {_limit(detail, field)}"


def _limit(detail: ErrorDetails, field: str) -> str:
    context: dict[str, Any] = detail.get("ctx", {})
    kind = detail["type"]
    if kind in {"greater_than", "greater_than_equal"}:
        return f"must be {'above' if kind == 'greater_than' else 'at least'} " + _bound(
            context, field, small=True
        )
    if kind in {"less_than", "less_than_equal"}:
        return f"must be {'below' if kind == 'less_than' else 'at most'} " + _bound(
            context, field, small=False
        )
    if kind == "finite_number":
        return "must be a finite number"
    if kind == "string_pattern_mismatch":
        return f"must match {context['pattern']} (letters, digits, dots and dashes; no folders)"
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind == "union_tag_invalid":
        return f"pattern must be one of {context['expected_tags']}"
    message = detail["msg"]
    return message[0].lower() + message[1:]


def _bound(context: dict[str, Any], field: str, *, small: bool) -> str:
    limit = context.get("gt", context.get("ge", context.get("lt", context.get("le"))))
    unit = field.rsplit("_", 1)[-1]
    if unit != "mm":
        return f"{limit:g}" if isinstance(limit, int | float) else f"{limit}"
    slip = "metres" if small else "micrometres"
    return f"{limit:g} mm; lengths are in millimetres (was it given in {slip}?)"


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= SHOWN_VALUE_CHARACTERS else text[: SHOWN_VALUE_CHARACTERS - 3] + "..."
