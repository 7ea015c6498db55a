"""Pydantic's findings as one message in the user's words: field, value, limit, way out."""

from __future__ import annotations

import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from design.errors import DesignError, shown
from design.fields.base import IDENTIFIER_PATTERN, NAME_PATTERN, nearest

LISTED_FINDINGS = 20
WORDED_FINDINGS = 100
"""Most findings in words: the search for a nearest name takes a millisecond, too long for thousands of findings."""

_WAY_OUT = {
    "missing": "is missing; add it (see `optopad schema`, or start from `optopad new`)",
    "union_tag_not_found": "lacks `pattern`; use one of ring, alternating_ring, facing_rows, per_side, single, "
    "or, on a disc, disc_ring, at_angles",
}


_BOUNDS = {
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
"""Requirement on a text, by the pattern that it does not match."""

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
    """All findings of a validation as one error.

    Parameters
    ----------
    err : pydantic's findings
    where : file or design that was being read
    known : dotted paths of all fields; the nearest are offered for an unknown one
    identifiers : identifiers of catalogue entries; the nearest is offered for an invalid one
    """
    details = err.errors(include_url=False)
    meant = [detail for detail in _of_the_branch_meant(details) if not _is_echo(detail)]
    lines = _lines(meant[:WORDED_FINDINGS], known, identifiers)
    told = lines[:LISTED_FINDINGS]
    if more := len(lines) - len(told) + len(meant[WORDED_FINDINGS:]):
        told.append(f"... and {more} more")
    return DesignError(f"{where}: not a usable design\n" + "\n".join(f"  {line}" for line in told))


def field_path(detail: ErrorDetails) -> str:
    """Dotted path of a finding, without pydantic's own union and type markers."""
    keys = [str(key) for key in detail["loc"] if isinstance(key, int) or not _is_marker(str(key))]
    return ".".join(keys) or "the file"


def _of_the_branch_meant(details: list[ErrorDetails]) -> list[ErrorDetails]:
    """Keep the findings of the given type where a field takes a value or a list, since pydantic reports both."""
    takes_a_list = {detail["loc"][:at] for detail in details if (at := _list_branch(detail)) is not None}
    takes_a_value = {detail["loc"][:-1] for detail in details if _list_branch(detail) is None}

    def is_meant(detail: ErrorDetails) -> bool:
        at = _list_branch(detail)
        if at is None:
            return detail["loc"][:-1] not in takes_a_list or not isinstance(detail["input"], list | tuple)
        return detail["type"] != "tuple_type" or detail["loc"][:at] not in takes_a_value

    return [detail for detail in details if is_meant(detail)]


def _list_branch(detail: ErrorDetails) -> int | None:
    """Position in a finding's path of the list of a field that also takes a single value."""
    return next((at for at, key in enumerate(detail["loc"]) if str(key).startswith("tuple[")), None)


def _is_echo(detail: ErrorDetails) -> bool:
    """Whether a list is reported as too short only because each of its entries was refused."""
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
        "ring",
    }


def _lines(details: list[ErrorDetails], known: tuple[str, ...], identifiers: tuple[str, ...]) -> list[str]:
    """One line per finding; a value that may be of several kinds has one for all of them."""
    limits: dict[str, list[str]] = {}
    for detail in details:
        said, limit = _finding(detail, known, identifiers)
        given = limits.setdefault(said, [])
        if limit and limit not in given:
            given.append(limit)
    return [said + " or ".join(given) for said, given in limits.items()]


def _finding(detail: ErrorDetails, known: tuple[str, ...], identifiers: tuple[str, ...]) -> tuple[str, str]:
    """The refusal, and the limit; the limit is empty where the refusal includes it."""
    field, kind = field_path(detail), detail["type"]
    if kind == "extra_forbidden":
        return f"{field}: is not a field of a design; {_near(field, known)}", ""
    if kind in _WAY_OUT:
        return f"{field}: {_WAY_OUT[kind]}", ""
    if kind == "value_error":  # raised by a rule of optopad, which names its values itself
        return f"{field}: {detail['msg'].removeprefix('Value error, ')}".removeprefix("the file: "), ""
    return f"{field}: {shown(detail['input'])} is refused: ", _limit(detail, field, identifiers)


def _near(field: str, known: tuple[str, ...]) -> str:
    """Names that are similar to a misspelt one."""
    parent = field.rpartition(".")[0]
    near = nearest(field, tuple(path for path in known if path.rpartition(".")[0] == parent))
    hint = f"did you mean {', '.join(near)}? Else " if near else ""
    return f"{hint}remove it or correct its spelling (see `optopad schema`)"


def _near_identifier(detail: ErrorDetails, identifiers: tuple[str, ...]) -> str:
    """The catalogue entry that the user likely meant."""
    if detail["ctx"]["pattern"] != IDENTIFIER_PATTERN:
        return ""
    near = nearest(re.sub(r"[^a-z0-9]+", "-", str(detail["input"]).lower()).strip("-"), identifiers)
    return f"; did you mean {near[0]}?" if near else ""


def _limit(detail: ErrorDetails, field: str, identifiers: tuple[str, ...]) -> str:
    context: dict[str, Any] = detail.get("ctx", {})
    kind = detail["type"]
    if kind in _BOUNDS:
        return f"must be {_BOUNDS[kind]} {_bound(detail, field)}"
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
    """The exceeded limit, and for lengths the unit that the user likely meant."""
    limit = next(iter(detail["ctx"].values()))
    said = f"{limit:.12g}" if isinstance(limit, int | float) else f"{limit}"
    if not field.endswith("_mm"):
        return said
    too_small = detail["type"].startswith("greater")
    slip = "micrometres" if not too_small else "metres" if detail["input"] > 0 else None
    hint = f" (was it given in {slip}?)" if slip else ""
    return f"{said} mm; lengths are in millimetres{hint}"
