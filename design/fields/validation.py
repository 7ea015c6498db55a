"""Conversion of pydantic's validation errors into one message for the user: field, value, limit and remedy."""

from __future__ import annotations

import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from optopad.design.errors import DesignError, shown
from optopad.design.fields.base import IDENTIFIER_PATTERN, NAME_PATTERN, nearest, sheet_name_hint

LISTED_FINDINGS = 20
WORDED_FINDINGS = 50
"""Largest number of findings that are described in words; searching for similar names takes 1 to 20 ms for each."""

_WAY_OUT = {
    "missing": "is missing; add it (see `optopad schema`, or start from `optopad new`)",
    "union_tag_not_found": "lacks `pattern`; use one of ring, alternating_ring, facing_rows, per_side, single, "
    "or, on a disc, disc_ring, at_angles",
}


BOUNDS = {
    "greater_than": "above",
    "greater_than_equal": "at least",
    "less_than": "below",
    "less_than_equal": "at most",
}

PATTERN_WORDS = {
    NAME_PATTERN: "letters, digits, dots, dashes and underscores, a letter or digit first, at most 63; no folders",
    IDENTIFIER_PATTERN: "small letters, digits and dashes, a letter or digit first, at most 63",
    r"^[A-Za-z0-9 ._+/-]*$": "letters, digits, blanks and . _ + / -",
    r"^[A-Za-z][A-Za-z0-9_-]{0,15}$": "letters, digits, underscores and dashes, a letter first, at most 16",
    r"^[0-9a-f]{4}:[0-9a-f]{4}$": "vendor:product as hexadecimal digits in small letters, as 2341:0042",
    r"^atmega[0-9a-z]+$": "the chip as the compiler names it, as atmega2560",
    r"^[0-9a-f]{6}$": "six hexadecimal digits in small letters, as 1e9801",
    r"^[A-L][0-7]$": "a port letter and a bit, as B7",
    r"^[A-Z][A-Z0-9_]*_vect$": "an interrupt vector as avr-libc names it, as USART0_RX_vect",
    r"^[ER]{2,32}$": "E for an emitter and R for a receiver, 2 to 32 letters, as ERR",
    r"^[A-Za-z0-9_.-]+(:[A-Za-z0-9_.-]+){2}(:[A-Za-z0-9_.,=-]+)?$": "a board as arduino-cli names it, as "
    "teensy:avr:teensy40",
    r"^[A-Z_][A-Za-z0-9_]*$": "a macro of C, as ARDUINO_TEENSY40",
    r"^A?[0-9]{1,3}$": "an input as the Arduino core names it, as A0 or 26",
    r"^[A-Z]{3}$": "an ISO 4217 code in capital letters, as EUR",
    r"^\d{4}-(0[1-9]|1[0-2])(-(0[1-9]|[12]\d|3[01]))?$": "a date as 2026-05 or 2026-05-04",
}
"""Descriptions of the permitted texts, each under its regular expression."""

_WANTED = {
    "finite_number": "must be a finite number",
    "float_type": "must be a number, without unit or quotes",
    "int_type": "must be a whole number, without unit or quotes",
    "int_from_float": "must be a whole number",
    "string_type": 'must be text, in quotes: "..."',
    "tuple_type": "must be a list: [..., ...]",
    "dict_type": "must be a table of fields",
    "model_type": "must be a table of fields",
    "model_attributes_type": "must be a table of fields",
}


def design_error(
    err: ValidationError, where: str, known: tuple[str, ...] = (), identifiers: tuple[str, ...] = ()
) -> DesignError:
    """Convert all findings of a validation into one error with a line for each.

    Parameters
    ----------
    err : pydantic's error with all findings
    where : name of the file or design, for the message
    known : dotted paths of all fields; the message suggests similar ones for an unknown field
    identifiers : identifiers of catalogue entries; the message suggests a similar one for an invalid identifier
    """
    details = err.errors(include_url=False)
    meant = [detail for detail in _of_the_branch_meant(details) if not _is_echo(detail)]
    lines = _lines(meant[:WORDED_FINDINGS], known, identifiers)
    told = lines[:LISTED_FINDINGS]
    if more := len(lines) - len(told) + len(meant[WORDED_FINDINGS:]):
        told.append(f"... and {more} more")
    return DesignError(f"{where}: not a usable design\n" + "\n".join(f"  {line}" for line in told))


def field_path(detail: ErrorDetails) -> str:
    """Dotted path of the field in a finding, without the union and type markers that pydantic adds."""
    keys = [str(key) for key in detail["loc"] if isinstance(key, int) or not _is_marker(str(key))]
    return ".".join(keys) or "the file"


def _of_the_branch_meant(details: list[ErrorDetails]) -> list[ErrorDetails]:
    """Remove findings about the other type where a field accepts a single value or a list.

    Pydantic reports both alternatives; only findings about the type that the user gave are kept.
    """
    takes_a_list = {detail["loc"][:at] for detail in details if (at := _list_branch(detail)) is not None}
    takes_a_value = {detail["loc"][:-1] for detail in details if _list_branch(detail) is None}

    def is_meant(detail: ErrorDetails) -> bool:
        at = _list_branch(detail)
        if at is None:
            return detail["loc"][:-1] not in takes_a_list or not isinstance(detail["input"], list | tuple)
        return detail["type"] != "tuple_type" or detail["loc"][:at] not in takes_a_value

    return [detail for detail in details if is_meant(detail)]


def _list_branch(detail: ErrorDetails) -> int | None:
    """Index in a validation error's path at which the list type of a field begins; None if it has no list type."""
    return next((at for at, key in enumerate(detail["loc"]) if str(key).startswith("tuple[")), None)


def _is_echo(detail: ErrorDetails) -> bool:
    """Whether pydantic reports a list as too short only because entries of the list were refused."""
    return detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]


def _is_marker(key: str) -> bool:
    return "[" in key or key in {
        "int",
        "float",
        "constrained-float",
        "constrained-int",
        "alternating_ring",
        "facing_rows",
        "per_side",
        "single",
        "disc_ring",
        "at_angles",
        "grid",
        "checkerboard",
        "ring_inside",
        "ring",
    }


def _lines(details: list[ErrorDetails], known: tuple[str, ...], identifiers: tuple[str, ...]) -> list[str]:
    """One line per finding; the limits of findings with equal text are joined by "or"."""
    limits: dict[str, list[str]] = {}
    for detail in details:
        said, limit = _finding(detail, known, identifiers)
        given = limits.setdefault(said, [])
        if limit and limit not in given:
            given.append(limit)
    return [said + " or ".join(given) for said, given in limits.items()]


def _finding(detail: ErrorDetails, known: tuple[str, ...], identifiers: tuple[str, ...]) -> tuple[str, str]:
    """Text of a finding, and the limit, which is empty if the text already includes it."""
    field, kind = field_path(detail), detail["type"]
    if kind == "extra_forbidden":
        return f"{field}: is not a field of a design; {_near(field, known)}", ""
    if kind in _WAY_OUT:
        return f"{field}: {_WAY_OUT[kind]}", ""
    if kind == "value_error":  # raised by a rule of optopad, whose text already has the values
        return f"{field}: {detail['msg'].removeprefix('Value error, ')}".removeprefix("the file: "), ""
    return f"{field}: {shown(detail['input'])} is refused: ", _limit(detail, field, identifiers)


def _near(field: str, known: tuple[str, ...]) -> str:
    """Remedy for an unknown field: known names that are similar to it, if any, or removing the field."""
    if hint := sheet_name_hint(field):
        return hint
    parent = field.rpartition(".")[0]
    near = nearest(field, tuple(path for path in known if path.rpartition(".")[0] == parent))
    hint = f"did you mean {', '.join(near)}? Else " if near else ""
    return f"{hint}remove it or correct its spelling (see `optopad schema`)"


def _near_identifier(detail: ErrorDetails, identifiers: tuple[str, ...]) -> str:
    """The catalogue identifier most similar to an invalid one, as a suggestion; may be empty."""
    if detail["ctx"]["pattern"] != IDENTIFIER_PATTERN:
        return ""
    near = nearest(re.sub(r"[^a-z0-9]+", "-", str(detail["input"]).lower()).strip("-"), identifiers)
    return f"; did you mean {near[0]}?" if near else ""


def _limit(detail: ErrorDetails, field: str, identifiers: tuple[str, ...]) -> str:
    context: dict[str, Any] = detail.get("ctx", {})
    kind = detail["type"]
    if kind in BOUNDS:
        return f"must be {BOUNDS[kind]} {_bound(detail, field)}"
    if kind == "tuple_type" and isinstance(detail["input"], dict):
        return f"must be a list of tables: write [[{field}]]"
    if kind in _WANTED:
        return _WANTED[kind]
    if kind == "too_short":
        return f"must have at least {context['min_length']} entries"
    if kind == "too_long":
        return f"must have at most {context['max_length']} entries, has {context['actual_length']}"
    if kind == "string_pattern_mismatch":
        return f"must be {PATTERN_WORDS[context['pattern']]}{_near_identifier(detail, identifiers)}"
    if kind == "string_too_long":
        return f"must have at most {context['max_length']} characters"
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind == "union_tag_invalid":
        return f"pattern must be one of {context['expected_tags']}"
    message = detail["msg"]
    return message[0].lower() + message[1:]


def _bound(detail: ErrorDetails, field: str) -> str:
    """The exceeded limit as text; for a length, it may ask whether the value was given in another unit."""
    limit = next(iter(detail["ctx"].values()))
    said = f"{limit:.12g}" if isinstance(limit, int | float) else f"{limit}"
    if not field.endswith("_mm"):
        return said
    too_small = detail["type"].startswith("greater")
    slip = "micrometres" if not too_small else "metres" if detail["input"] > 0 else None
    hint = f" (was it given in {slip}?)" if slip else ""
    return f"{said} mm; lengths are in millimetres{hint}"
