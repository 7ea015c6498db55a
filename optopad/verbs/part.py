"""A part of the user's own for the catalogue, from its data sheet."""

from __future__ import annotations

import math
import re
import sys
from pathlib import Path
from typing import Any

import typer

from optopad.cli.verb import file_name, typed, verb
from optopad.design.errors import DesignError, InputError
from optopad.design.fields.base import IDENTIFIER_PATTERN
from optopad.design.fields.validation import PATTERN_WORDS
from optopad.design.io import catalog_file_entries, read_design_text, write_text_atomically
from optopad.design.part_entry import LedSheet, PartEntry, PhotodiodeSheet, part_entry
from optopad.design.parts.catalog import packaged
from optopad.design.parts.photometry import Intensity
from optopad.design.toml_text import parsed_toml
from optopad.screen.catalogue import new_part_lines
from optopad.screen.output import Told

KINDS = ("led", "photodiode")
Given = dict[str, Any]
"""Texts of the options by name, with dashes; None for those that were left out."""

QUESTIONS = {
    "kind": "Kind (led or photodiode)",
    "package": "Package (radial-5mm, radial-3mm, side-looking-5mm, side-looking-thin, plcc-2, 0805, coupler-tcrt5000 "
    "or coupler-qre1113)",
    "intensity": "Intensity on the axis, with its unit (as 250mcd or 12mW/sr)",
    "viewing-angle": "Viewing angle 2θ½, the full angle of half intensity [deg]",
    "led-wavelength": "Wavelength, peak or dominant [nm] (white for a white LED)",
    "photodiode-wavelength": "Wavelength of the responsivity [nm]",
    "current": "Test current of the intensity [mA]",
    "area": "Sensitive area (as 7.5 for mm2, or 2.65x2.65 for mm)",
    "responsivity": "Responsivity [A/W]",
    "half-angle": "Half angle θ½, from the axis [deg]",
}
"""Prompts by option; those of an option that means another thing for each kind have the kind before it."""
NEEDED = {
    "led": ("package", "intensity", "viewing-angle", "wavelength", "current"),
    "photodiode": ("package", "area", "responsivity", "wavelength", "half-angle"),
}
LED_ONLY = ("intensity", "current", "max-current", "forward-voltage")
PHOTODIODE_ONLY = ("area", "responsivity", "dark-current", "capacitance")
LIMITS = {
    "wavelength": (200.0, 2000.0, "nm", "wavelengths are in nanometres"),
    "current": (0.0, 5000.0, "mA", "currents are positive and in mA"),
    "max-current": (0.0, 5000.0, "mA", "currents are positive and in mA"),
    "forward-voltage": (0.0, 20.0, "V", "voltages are positive and in V"),
    "responsivity": (0.0, 2.0, "A/W", "give the value at --wavelength in A/W"),
    "dark-current": (0.0, 1e6, "nA", "dark currents are in nA"),
    "capacitance": (0.0, 1e6, "pF", "capacitances are in pF"),
    "viewing-angle": (
        2.0,
        178.0,
        "deg",
        "a viewing angle is the full angle 2θ½ between both half intensities",
    ),
    "half-angle": (
        1.0,
        89.0,
        "deg",
        "a half angle is from the axis; is it a viewing angle? then --viewing-angle",
    ),
}
"""Range of each number, its unit and a remedy; a low end of 0 is excluded, except for dark currents."""
_NUMBER = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
_UNITS = {"mcd": ("mcd", 1.0), "cd": ("mcd", 1e3), "mw/sr": ("mW/sr", 1.0), "w/sr": ("mW/sr", 1e3)}


@verb(
    name=typed("NAME"),
    kind=typed("led|photodiode"),
    package=typed("NAME"),
    intensity=typed("VALUE"),
    viewing_angle=typed("DEG"),
    half_angle=typed("DEG"),
    wavelength=typed("NM"),
    current=typed("MA"),
    max_current=typed("MA"),
    forward_voltage=typed("V"),
    area=typed("AREA"),
    responsivity=typed("A/W"),
    dark_current=typed("NA"),
    capacitance=typed("PF"),
    lens=typed("filed|kept"),
    source=typed("TEXT"),
    manufacturer=typed("TEXT"),
    title=typed("TEXT"),
    out=typed("FILE", type=Path, callback=file_name(".toml")),
)
def new(
    name: str,
    *,
    kind: str | None = None,
    package: str | None = None,
    intensity: str | None = None,
    viewing_angle: str | None = None,
    half_angle: str | None = None,
    wavelength: str | None = None,
    current: str | None = None,
    max_current: str | None = None,
    forward_voltage: str | None = None,
    area: str | None = None,
    responsivity: str | None = None,
    dark_current: str | None = None,
    capacitance: str | None = None,
    lens: str | None = None,
    source: str | None = None,
    manufacturer: str | None = None,
    title: str | None = None,
    out: Path | None = None,
    as_json: bool = False,
) -> Told:
    """Write the catalogue entry of an LED or a photodiode from its data sheet.

    Parameters
    ----------
    name : Identifier of the part: small letters, digits, dashes.
    kind : What the part is; prompted for if left out.
    package : radial-5mm, radial-3mm, side-looking-5mm, side-looking-thin, plcc-2, 0805, coupler-tcrt5000 or
        coupler-qre1113.
    intensity : LED: intensity on the axis, as 250mcd or 12mW/sr.
    viewing_angle : Viewing angle 2θ½: the full angle.
    half_angle : Half angle ±θ½ from the axis, instead of --viewing-angle.
    wavelength : LED: peak or dominant, or `white`; photodiode: of the responsivity.
    current : LED: test current of the intensity.
    max_current : LED: largest continuous current; else --current.
    forward_voltage : LED: at --current; else usual for its colour.
    area : Photodiode: sensitive area, as 7.5 for mm2 or 2.65x2.65 for mm x mm.
    responsivity : Photodiode: responsivity at --wavelength.
    dark_current : Photodiode: typical; else 2 nA.
    capacitance : Photodiode: without bias; else 10 pF per mm2.
    lens : Dome of a round part: filed flat (the default), or kept on.
    source : Name of the data sheet, as its number and revision.
    manufacturer : Who makes it.
    title : Full name; else NAME.
    out : Catalogue file; the entry is appended if it exists. Default: NAME.toml.
    """
    given: Given = {word.replace("_", "-"): text for word, text in locals().items()}
    given = {word: given[word] for word in given if word not in ("name", "out", "as-json")}
    _require_identifier(name)
    given, prompted = _completed(given, may_prompt=not as_json)
    while True:
        try:
            entry = part_entry(_sheet(name, given))
            break
        except InputError as err:
            wrong = re.match(r"--([a-z-]+):", str(err))
            if wrong is None or wrong.group(1) not in prompted:
                raise
            typer.echo(f"{err}", err=True)
            given |= {wrong.group(1): typer.prompt(prompted[wrong.group(1)])}
    file = out or Path(f"{name}.toml")
    _write(entry, file)
    return Told({"file": str(file), **entry.document()}, new_part_lines(entry, file))


def _require_identifier(name: str) -> None:
    if not re.fullmatch(IDENTIFIER_PATTERN, name):
        plain = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:63] or "my-part"
        raise InputError(
            f"NAME: {name!r} is refused: must be {PATTERN_WORDS[IDENTIFIER_PATTERN]}; use {plain}"
        )
    if name in packaged().parts:
        raise InputError(
            f"NAME: {name} is a packaged part, which an entry of this name would replace; use my-{name}, or give "
            f"single values that you measured under [part_measurements.{name}] of the design"
        )


def _completed(given: Given, *, may_prompt: bool) -> tuple[Given, dict[str, str]]:
    """The options with those that are missing, from prompts on a terminal; and the questions of these prompts.

    Raises
    ------
    InputError : without a terminal, options are missing; or an option belongs to the other kind of part.
    """
    prompts = may_prompt and sys.stdin.isatty() and sys.stdout.isatty()
    said = given["kind"]
    while True:
        kind = (typer.prompt(QUESTIONS["kind"]) if said is None and prompts else said or "").strip().lower()
        if kind in KINDS or said is not None or not prompts:
            break
    if kind not in KINDS:
        raise InputError(
            f"--kind: {'is missing' if said is None else f'{said!r} is refused'}; give led or photodiode"
        )
    missing = [name for name in NEEDED[kind] if _is_missing(given, name)]
    if missing and not prompts:
        named = ", ".join(f"--{name}" for name in missing)
        raise InputError(f"{named}: missing for a {kind}; add {'them' if len(missing) > 1 else 'it'}")
    asked = {name: QUESTIONS.get(f"{kind}-{name}") or QUESTIONS[name] for name in missing}
    given = given | {"kind": kind} | {name: typer.prompt(question) for name, question in asked.items()}
    foreign = [name for name in (PHOTODIODE_ONLY if kind == "led" else LED_ONLY) if given[name] is not None]
    if foreign:
        raise InputError(f"--{foreign[0]}: {given[foreign[0]]} is refused: a {kind} has none; leave it out")
    return given, asked


def _is_missing(given: Given, name: str) -> bool:
    if name in ("viewing-angle", "half-angle"):
        return given["viewing-angle"] is None and given["half-angle"] is None
    return given[name] is None


def _sheet(name: str, given: Given) -> LedSheet | PhotodiodeSheet:
    """The data sheet in the options; raises InputError."""
    if given["lens"] not in (None, "filed", "kept"):
        raise InputError(f"--lens: {given['lens']!r} is refused; give filed or kept")
    common: Given = {
        "part_id": name,
        "package": given["package"],
        "half_angle_deg": _half_angle_deg(given),
        **{key: given[key] for key in ("lens", "source", "manufacturer", "title")},
    }
    if given["kind"] == "photodiode":
        return PhotodiodeSheet(
            **common,
            area_mm=_area_mm(given["area"]),
            responsivity_a_per_w=_number(given, "responsivity"),
            wavelength_nm=_number(given, "wavelength"),
            dark_current_na=_number_or_none(given, "dark-current"),
            capacitance_pf=_number_or_none(given, "capacitance"),
        )
    is_white = given["wavelength"].strip().lower() == "white"
    most_ma, test_ma = _number_or_none(given, "max-current"), _number(given, "current")
    return LedSheet(
        **common,
        intensity=_intensity(given["intensity"]),
        wavelength_nm=None if is_white else _number(given, "wavelength"),
        current_ma=test_ma,
        max_current_ma=most_ma,
        forward_voltage_v=_number_or_none(given, "forward-voltage"),
    )


def _number_or_none(given: Given, name: str) -> float | None:
    return None if given[name] is None else _number(given, name)


def _number(given: Given, name: str) -> float:
    """A number of the options within its range, with or without its unit; raises InputError."""
    low, high, unit, way_out = LIMITS[name]
    text = given[name]
    found = re.fullmatch(_NUMBER + f"(?:{re.escape(unit)}|°)?", text)
    value = float(found.group(1)) if found else math.nan
    includes_low = low > 0.0 or name == "dark-current"
    if not (low <= value <= high and (includes_low or value > low)):
        said = f"{found.group(1)} {unit}" if found else repr(text)
        least = f"{low:g}" if includes_low else f"above {low:g}"
        raise InputError(f"--{name}: {said} is refused: must be {least} to {high:g} {unit}; {way_out}")
    return value


def _half_angle_deg(given: Given) -> float:
    if given["viewing-angle"] is not None and given["half-angle"] is not None:
        raise InputError(
            f"--viewing-angle: {given['viewing-angle']} and --half-angle: {given['half-angle']} are both given; "
            "give one: the viewing angle is the full angle, twice the half angle"
        )
    if given["half-angle"] is not None:
        return _number(given, "half-angle")
    return _number(given, "viewing-angle") / 2.0


def _intensity(text: str) -> Intensity:
    """The intensity of an option such as 250mcd, 0.25cd or 12mW/sr; raises InputError."""
    found = re.fullmatch(_NUMBER + r"([^\d\s].*)?", text.strip())
    unit = (found.group(2) or "").strip().lower() if found else ""
    if found is None or unit not in _UNITS:
        said = "has no unit" if found is not None and not unit else "is refused"
        raise InputError(
            f"--intensity: {text!r} {said}: give a number with mcd, cd, mW/sr or W/sr, as 250mcd or 12mW/sr, the "
            "intensity on the axis (not the flux in lm or mW)"
        )
    name, factor = _UNITS[unit]
    value = float(found.group(1)) * factor
    if not 0.0 < value <= 1e6:
        raise InputError(
            f"--intensity: {text} is refused: must be above 0 to 1e+06 {name}; give the typical value"
        )
    return Intensity(value=value, unit="mcd" if name == "mcd" else "mW/sr")


def _area_mm(text: str) -> tuple[float, float]:
    """Width and height of an area such as 7.5 (mm2) or 2.65x2.65 (mm); raises InputError."""
    found = re.fullmatch(_NUMBER + "(?:mm2|mm²)?", text) or re.fullmatch(
        _NUMBER + "(?:mm)?" + r"\s*[x×]" + _NUMBER + "(?:mm)?", text
    )
    numbers = [float(one) for one in found.groups()] if found else [math.nan]
    sides = (math.sqrt(abs(numbers[0])),) * 2 if len(numbers) == 1 else (numbers[0], numbers[1])
    if not (all(0.0 < side <= 100.0 for side in sides) and min(numbers) > 0.0):
        raise InputError(
            f"--area: {text!r} is refused: give the sensitive area above 0, as 7.5 in mm2 or 2.65x2.65 in mm"
        )
    return round(sides[0], 3), round(sides[1], 3)


def _write(entry: PartEntry, file: Path) -> None:
    """Write the entry to a new catalogue file, or append it to one that exists.

    Raises
    ------
    InputError : the file is not a catalogue, or has a part of this name.
    """
    text = entry.text()
    parsed_toml(text)
    if file.exists():
        try:
            held = catalog_file_entries(file)
        except DesignError as err:
            raise InputError(f"--out {err}; choose another file") from None
        if entry.part_id in held.parts:
            raise InputError(
                f"--out {file}: has a part {entry.part_id} already; remove it there, or choose another NAME or file"
            )
        text = read_design_text(file).rstrip("\n") + "\n\n" + text
    write_text_atomically(file, text)
