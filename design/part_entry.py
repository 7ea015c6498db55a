"""Catalogue entry of an LED or a photodiode from the quantities that its data sheet states.

The sizes come from a table of packages (`design/data/packages.toml`), radiant power from the intensity on the axis
(`optopad.design.parts.photometry`). The entry has comments with the rules that were used, where the legs leave, and how
the part fits: heights at which the body ends flush with the clear layer, and the least wall of the housing.

The least wall has the depth of the body, the gap around it and one web behind it, with the mold's default values. The
fixing holes, and other parts of the design, may need more; `optopad check` says so.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from textwrap import wrap
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from optopad.design.errors import InputError
from optopad.design.fields.base import Model, nearest
from optopad.design.fields.packaged import data_quantities, data_table
from optopad.design.fields.quantity import HalfAngleDeg, LengthMm, Quantity, Text
from optopad.design.parts import catalog
from optopad.design.parts.angular import FLAT_FACE_LEAST_DEG
from optopad.design.parts.catalog import Part
from optopad.design.parts.photometry import (
    Intensity,
    efficacy_lm_per_w,
    radiant_intensity_mw_per_sr,
    radiant_power_mw,
)
from optopad.design.spec import Mold

LAMBERTIAN_DEG = 60.0
EPOXY_INDEX = 1.53
"""Index of clear LED epoxy; makers state 1.50 to 1.55 (recalled)."""
ELASTOMER_INDEX = 1.41
SIDE_OF_BODY_DEG = 45.0
"""Angle beyond which light of a filed round LED meets the side of its body [deg]."""

Lens = Literal["filed", "kept", "none"]
View = Literal["top", "side"]


class Package(Model):
    """Sizes of a package as it is mounted behind a wall: width along the wall, depth into it, height upward."""

    title: Text
    mounting: Literal["radial", "surface"]
    view: View
    legs: Annotated[Text, Field(description="where the legs leave")]
    body_width_mm: LengthMm
    body_depth_mm: LengthMm
    body_height_mm: LengthMm
    dome_mm: Annotated[LengthMm | None, Field(description="length of the dome, which a file removes")] = None
    active_width_mm: LengthMm
    active_height_mm: LengthMm
    active_height_in_body_mm: LengthMm
    lead_pitch_mm: LengthMm
    lead_diameter_mm: LengthMm
    lead_setback_mm: LengthMm | None = None
    lead_count: int
    notes: tuple[Text, ...] = ()

    def depth_mm(self, lens: Lens) -> Quantity:
        """Depth of the body into the wall, without the dome if that is filed off [mm]."""
        depth, dome = self.body_depth_mm, self.dome_mm
        if lens != "filed" or dome is None:
            return depth
        ends = [None if end is None else round(end - dome.value, 6) for end in (depth.low, depth.high)]
        return Quantity(
            value=round(depth.value - dome.value, 6),
            unit="mm",
            source=f"{depth.value:g} mm ({depth.source}) less the dome of {dome.value:g} mm, filed flat",
            confidence="inferred",
            low=ends[0],
            high=ends[1],
        )


@cache
def packages() -> dict[str, Package]:
    """The known packages by name."""
    table = data_table("packages.toml")["packages"]
    return {name: Package.model_validate(fields) for name, fields in table.items()}


def find_package(name: str) -> Package:
    """Find a package by its name; InputError with similar names if there is none."""
    known = packages()
    if name not in known:
        near = nearest(name.lower().replace(" ", "-"), tuple(known))
        hint = f"did you mean {near[0]}? " if near else ""
        raise InputError(
            f"--package: {name!r} is refused: {hint}known are {', '.join(known)}; for another package take the "
            "nearest, and correct the sizes in the entry"
        )
    return known[name]


def half_angle_in_elastomer(half_angle: HalfAngleDeg, lens: Lens) -> Quantity:
    """Half angle of a part in elastomer [deg], from the data sheet's half angle in air and what becomes of its lens."""
    air_deg = half_angle.value
    if lens == "none":
        return half_angle
    if lens == "filed":
        return Quantity(
            value=LAMBERTIAN_DEG,
            unit="deg",
            source=f"assumed Lambertian behind a face filed flat; {air_deg:g} deg with the dome in air; band: from "
            "where the side of the body cuts the light off",
            confidence="unverified",
            low=SIDE_OF_BODY_DEG,
            high=65.0,
        )
    left = (EPOXY_INDEX / ELASTOMER_INDEX - 1.0) / (EPOXY_INDEX - 1.0)
    bedded_deg = round(LAMBERTIAN_DEG - (LAMBERTIAN_DEG - air_deg) * left, 1)
    return Quantity(
        value=bedded_deg,
        unit="deg",
        source=f"{air_deg:g} deg in air; a dome of epoxy (index {EPOXY_INDEX:g}) in silicone keeps {left:.0%} of "
        "its effect near the axis; estimated, not measured",
        confidence="unverified",
        low=min(SIDE_OF_BODY_DEG, bedded_deg),
        high=max(65.0, bedded_deg),
    )


WIDTH = 118
"""Longest line of a comment [characters]."""
DIGITS = 4
"""Significant digits of computed values."""
SPREAD = 2.0
"""Factor by which the power may be larger or smaller: sheets state typical intensities, and beams have side lobes."""
GREEN_ENDS_NM, RED_ENDS_NM = 560.0, 700.0
"""Longest wavelengths of InGaN chips (blue, green) and of AlGaInP chips (yellow to red)."""
NM_W_PER_A = 1240.0
"""Photon energy times wavelength, per charge: a photodiode with one electron per photon has wavelength / 1240 A/W."""


@dataclass(frozen=True, kw_only=True)
class Sheet:
    """Quantities that sheets of LEDs and of photodiodes state.

    Attributes
    ----------
    part_id : identifier of the entry
    package : name of a package, as `radial-5mm`
    half_angle_deg : angle between the axis and the direction of half intensity or sensitivity, in air
    lens : what becomes of the dome; None for filed flat, where there is one
    source : name of the sheet
    manufacturer, title : as in the catalogue; None for unknown, and for the name of the part
    """

    part_id: str
    package: str
    half_angle_deg: float
    lens: Literal["filed", "kept"] | None = None
    source: str | None = None
    manufacturer: str | None = None
    title: str | None = None


@dataclass(frozen=True, kw_only=True)
class LedSheet(Sheet):
    """Sheet of an LED.

    Attributes
    ----------
    intensity : on the axis, at `current_ma`
    wavelength_nm : peak or dominant wavelength; None for a white LED
    current_ma : test current of the intensity
    max_current_ma : largest continuous current; None for the test current, with a remark
    forward_voltage_v : at the test current; None for the usual one of the colour
    """

    intensity: Intensity
    wavelength_nm: float | None
    current_ma: float
    max_current_ma: float | None = None
    forward_voltage_v: float | None = None


@dataclass(frozen=True, kw_only=True)
class PhotodiodeSheet(Sheet):
    """Sheet of a photodiode.

    Attributes
    ----------
    area_mm : width and height of the sensitive area
    responsivity_a_per_w, wavelength_nm : responsivity, and the wavelength that it is stated for
    dark_current_na, capacitance_pf : None for usual values
    """

    area_mm: tuple[float, float]
    responsivity_a_per_w: float
    wavelength_nm: float
    dark_current_na: float | None = None
    capacitance_pf: float | None = None


@dataclass(frozen=True, kw_only=True)
class PartEntry:
    """A new entry of the catalogue.

    Attributes
    ----------
    part_id : its identifier
    part : its fields
    remarks : what the entry rests on and how the part fits, by title: light, current, lens, legs, flush, housing
    wall_mm : least thickness of the wall around the cavity
    pitch_mm : least distance of two of these parts on one wall
    """

    part_id: str
    part: Part
    remarks: dict[str, str]
    wall_mm: float
    pitch_mm: float

    @property
    def flush_floor_mm(self) -> float:
        """Height of the active area's centre at which the body ends flush with the bottom of the clear layer [mm]."""
        return self.part.active_height_in_body_mm.value

    @property
    def below_top_mm(self) -> float:
        """Distance of this centre below the top of the clear layer at which the body ends flush with the top [mm]."""
        return round(self.part.body_height_mm.value - self.flush_floor_mm, 6)

    def document(self) -> dict[str, Any]:
        """The entry as plain data for a program."""
        return {
            "part": self.part_id,
            "entry": self.part.model_dump(mode="json", exclude_none=True),
            "remarks": self.remarks,
            "flush_floor_height_mm": self.flush_floor_mm,
            "flush_top_below_surface_mm": self.below_top_mm,
            "least_wall_mm": self.wall_mm,
            "least_pitch_mm": self.pitch_mm,
        }

    def text(self) -> str:
        """The entry as a table of a catalogue file, with comments."""
        fields = self.part.model_dump(mode="json", exclude_none=True)
        lines = [f"# {self.part_id}, by `optopad part new`"]
        for title, remark in self.remarks.items():
            lines += wrap(
                f"{title}: {remark}",
                WIDTH,
                initial_indent="# ",
                subsequent_indent="#   ",
                break_on_hyphens=False,
            )
        lines += [f"[parts.{self.part_id}]"]
        lines += [f"{name} = {_toml(value)}" for name, value in fields.items() if value != []]
        return "\n".join(lines) + "\n"


def part_entry(sheet: LedSheet | PhotodiodeSheet) -> PartEntry:
    """Make the entry of a part from its data sheet.

    Raises
    ------
    InputError : the package is unknown, the package has no dome to file, the intensity cannot be converted, a size or
        value is out of the catalogue's range, or the power or the responsivity is physically impossible.
    """
    package = find_package(sheet.package)
    lens = _lens(sheet, package)
    own = _led(sheet) if isinstance(sheet, LedSheet) else _photodiode(sheet)
    angle = half_angle_in_elastomer(_read(sheet, sheet.half_angle_deg, "deg"), lens)
    fields = {
        "kind": "emitter" if isinstance(sheet, LedSheet) else "receiver",
        "title": sheet.title or sheet.part_id,
        "manufacturer": sheet.manufacturer or "unknown",
        "lead_count": package.lead_count,
        "mounting": package.mounting,
        "view": package.view,
        **_sizes(package, lens),
        "half_angle_deg": angle,
        **own,
        "notes": (f"Lens: {_lens_remark(sheet, lens, angle)}", *package.notes),
    }
    part = _validated(sheet.part_id, fields)
    room, web = (float(Mold.model_fields[name].default) for name in ("part_clearance_mm", "min_web_mm"))
    wall_mm = round(part.body_depth_mm.value + room + web, 6)
    pitch_mm = round(part.body_width_mm.value + 2 * room + web, 6)
    remarks = {
        "Light": _light_remark(sheet, part),
        **_current_remark(sheet),
        "Lens": _lens_remark(sheet, lens, angle),
        "Legs": f"{package.legs}.",
        "Flush": _flush_remark(part),
        "Housing": f"the wall is at least {wall_mm:g} mm thick ({part.body_depth_mm.value:g} of body, {room:g} of gap, "
        f"{web:g} behind it), so the mold is at least {2 * wall_mm:g} mm larger than the cavity in each direction "
        f"with parts; two of these parts on one wall are {pitch_mm:g} mm or more apart.",
    }
    if package.notes:
        remarks["Note"] = " ".join(package.notes)
    return PartEntry(part_id=sheet.part_id, part=part, remarks=remarks, wall_mm=wall_mm, pitch_mm=pitch_mm)


def _lens(sheet: Sheet, package: Package) -> Lens:
    if package.dome_mm is None:
        if sheet.lens is not None:
            raise InputError(
                f"--lens: {sheet.lens!r} is refused: the package {sheet.package} has no dome; leave --lens out"
            )
        return "none"
    return sheet.lens or "filed"


def _sizes(package: Package, lens: Lens) -> dict[str, Any]:
    names = [
        "active_width_mm",
        "active_height_mm",
        "body_width_mm",
        "body_height_mm",
        "active_height_in_body_mm",
        "lead_pitch_mm",
        "lead_diameter_mm",
        "lead_setback_mm",
    ]
    return {name: getattr(package, name) for name in names} | {"body_depth_mm": package.depth_mm(lens)}


def _led(sheet: LedSheet) -> dict[str, Any]:
    most_ma = sheet.max_current_ma or sheet.current_ma
    power_mw = _power_mw(sheet) * most_ma / sheet.current_ma
    forward = (
        _usual_voltage(sheet.wavelength_nm)
        if sheet.forward_voltage_v is None
        else _read(sheet, sheet.forward_voltage_v, "V", f"at {sheet.current_ma:g} mA")
    )
    _require_less_light_than_power(sheet, forward)
    return {
        "wavelength_nm": _wavelength(sheet),
        "forward_voltage_v": forward,
        "max_current_ma": _most_current(sheet),
        "radiant_power_mw": Quantity(
            value=_rounded(power_mw),
            unit="mW",
            source=f"{sheet.intensity} at {sheet.current_ma:g} mA ({_source(sheet)}){_by_efficacy(sheet)}; "
            f"2 pi I / (m + 1) with the half angle of {sheet.half_angle_deg:g} deg in air"
            + (f", times {most_ma / sheet.current_ma:.3g} for {most_ma:g} mA" if sheet.max_current_ma else "")
            + "; band: assumed, a factor of 2 for typical intensities and side lobes",
            confidence="inferred",
            low=_rounded(power_mw / SPREAD),
            high=_rounded(power_mw * SPREAD),
        ),
    }


def _power_mw(sheet: LedSheet) -> float:
    """Radiant power at the test current [mW]."""
    return radiant_power_mw(
        radiant_intensity_mw_per_sr(sheet.intensity, sheet.wavelength_nm), sheet.half_angle_deg
    )


def _require_less_light_than_power(sheet: LedSheet, forward: Quantity) -> None:
    volts = forward.value if forward.high is None else forward.high
    power_mw, limit_mw = _power_mw(sheet), volts * sheet.current_ma
    if power_mw > limit_mw:
        raise InputError(
            f"--intensity: {sheet.intensity} is refused: it is {power_mw:.3g} mW of light, and must be at most "
            f"{limit_mw:.3g} mW ({volts:g} V x {sheet.current_ma:g} mA); check its unit (mcd or cd), the angle and "
            "--current"
        )


def _most_current(sheet: LedSheet) -> Quantity:
    if sheet.max_current_ma is not None:
        return _read(sheet, sheet.max_current_ma, "mA", "continuous")
    source = f"{_source(sheet)}: test current, taken as the largest continuous current"
    return Quantity(value=sheet.current_ma, unit="mA", source=source, confidence="inferred")


def _current_remark(sheet: LedSheet | PhotodiodeSheet) -> dict[str, str]:
    """Remark on a test current that stands for the largest continuous current; none if the sheet's is given."""
    if isinstance(sheet, PhotodiodeSheet) or sheet.max_current_ma is not None:
        return {}
    return {
        "Current": f"the test current of {sheet.current_ma:g} mA is taken as the largest continuous current. Give that "
        "of the sheet with --max-current: a test current that is pulsed must not be used, since it may destroy the LED."
    }


def _by_efficacy(sheet: LedSheet) -> str:
    if sheet.intensity.unit == "mW/sr":
        return ""
    efficacy = efficacy_lm_per_w(sheet.wavelength_nm)
    return f", {efficacy.value:.3g} lm/W ({efficacy.source})"


def _wavelength(sheet: LedSheet) -> Quantity:
    if sheet.wavelength_nm is not None:
        return _read(sheet, sheet.wavelength_nm, "nm")
    return Quantity(
        value=550.0,
        unit="nm",
        source="assumed: phosphor band of a white LED (peaks near 450 and 550 nm)",
        confidence="unverified",
        low=450.0,
        high=620.0,
    )


def _usual_voltage(wavelength_nm: float | None) -> Quantity:
    """Forward voltage that is usual for an LED's colour [V]."""
    table = data_quantities("usual_parts.toml")
    if wavelength_nm is None or wavelength_nm <= GREEN_ENDS_NM:
        return table["forward_voltage_blue_green_white_v"]
    return table["forward_voltage_red_v" if wavelength_nm <= RED_ENDS_NM else "forward_voltage_infrared_v"]


def _photodiode(sheet: PhotodiodeSheet) -> dict[str, Any]:
    width_mm, height_mm = sheet.area_mm
    most = sheet.wavelength_nm / NM_W_PER_A
    if sheet.responsivity_a_per_w > most:
        raise InputError(
            f"--responsivity: {sheet.responsivity_a_per_w:g} A/W is refused: must be at most {most:.3g} A/W at "
            f"{sheet.wavelength_nm:g} nm (one electron per photon); give the value at --wavelength"
        )
    usual = data_quantities("usual_parts.toml")
    per_area = usual["capacitance_pf_per_mm2"]
    ends = (per_area.value, per_area.low or per_area.value, per_area.high or per_area.value)
    value, low, high = (_rounded(width_mm * height_mm * one) for one in ends)
    assumed_pf = Quantity(
        value=value, low=low, high=high, unit="pF", source=per_area.source, confidence=per_area.confidence
    )
    return {
        "active_width_mm": _read(sheet, width_mm, "mm"),
        "active_height_mm": _read(sheet, height_mm, "mm"),
        "responsivity_a_per_w": _read(sheet, sheet.responsivity_a_per_w, "A/W"),
        "responsivity_wavelength_nm": _read(sheet, sheet.wavelength_nm, "nm"),
        "dark_current_na": usual["dark_current_na"]
        if sheet.dark_current_na is None
        else _read(sheet, sheet.dark_current_na, "nA"),
        "capacitance_pf": assumed_pf
        if sheet.capacitance_pf is None
        else _read(sheet, sheet.capacitance_pf, "pF"),
    }


def _light_remark(sheet: LedSheet | PhotodiodeSheet, part: Part) -> str:
    if isinstance(sheet, PhotodiodeSheet):
        return (
            f"{sheet.responsivity_a_per_w:g} A/W at {sheet.wavelength_nm:g} nm on "
            f"{sheet.area_mm[0]:g} x {sheet.area_mm[1]:g} mm; at other wavelengths it differs: see the "
            "sheet's curve."
        )
    assert part.radiant_power_mw is not None  # every LED's entry has it
    axis = radiant_intensity_mw_per_sr(sheet.intensity, sheet.wavelength_nm)
    converted = "" if sheet.intensity.unit == "mW/sr" else f" is {axis:.3g} mW/sr{_by_efficacy(sheet)}"
    return (
        f"{sheet.intensity}{converted}; as cos^m with the half angle of {sheet.half_angle_deg:g} deg in air that is "
        f"{_power_mw(sheet):.3g} mW at {sheet.current_ma:g} mA, so {part.radiant_power_mw.value:.3g} mW at "
        f"max_current_ma, to a factor of {SPREAD:g}."
    )


def _lens_remark(sheet: Sheet, lens: Lens, angle: Quantity) -> str:
    if lens == "filed":
        return (
            f"file the dome flat and polish it: the half angle is then about {angle.value:g} deg (Lambertian, assumed; "
            f"beyond about {angle.low:g} deg the side of the body takes light) instead of {sheet.half_angle_deg:g} deg."
        )
    if lens == "kept":
        return (
            f"the dome stays on. In silicone it keeps a sixth of its effect: about {angle.value:g} deg (estimated) "
            f"instead of {sheet.half_angle_deg:g} deg in air. Its tip is flush with the wall."
        )
    said = f"no dome: the half angle of {sheet.half_angle_deg:g} deg is used as the sheet states it"
    if sheet.half_angle_deg < FLAT_FACE_LEAST_DEG:
        said += ", but so narrow a beam comes from a lens, which loses most of its effect in silicone"
    return f"{said}."


def _flush_remark(part: Part) -> str:
    base, height = part.active_height_in_body_mm.value, part.body_height_mm.value
    return (
        f"the body ends flush with the bottom of the clear layer at height_mm = {base:g}, and flush with its top at "
        f"cavity.clear_thickness_mm - {height - base:g}; a clear layer of {height:g} mm has both."
    )


def _validated(part_id: str, fields: dict[str, Any]) -> Part:
    try:
        part = Part.model_validate(fields)
    except ValidationError as err:
        first = err.errors(include_url=False)[0]
        named = ".".join(map(str, first["loc"]))
        said = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{part_id}: {f'{named}: ' if named else ''}{said}") from None
    catalog.parse_entries({"parts": {part_id: part.model_dump(mode="json", exclude_none=True)}}, part_id)
    return part


def _source(sheet: Sheet) -> str:
    return sheet.source or f"data sheet of {sheet.part_id}"


def _read(sheet: Sheet, value: float, unit: str, remark: str = "") -> Quantity:
    said = f"{_source(sheet)}: {remark}" if remark else _source(sheet)
    return Quantity(value=value, unit=unit, source=said, confidence="read")


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _toml(value: Any) -> str:
    """A plain value as TOML on one line; JSON writes texts as TOML does, but for the control character DEL."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_toml(one)}" for name, one in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
