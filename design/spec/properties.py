"""Physical values of a design: the catalogue's values, or measured values that the design gives in their place.

Every value has a unit, a source, a confidence, and a band that is believed to contain the true value.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from pydantic import ValidationError

from optopad.design.errors import DesignError
from optopad.design.fields.base import get_at, sheet_name_hint
from optopad.design.fields.packaged import data_quantities, data_table
from optopad.design.fields.quantity import NM_PER_UM, Confidence, Quantity, lambertian_order
from optopad.design.once import once
from optopad.design.parts import catalog
from optopad.design.parts.catalog import CatalogEntries, Elastomer, Part
from optopad.design.parts.spectrum import SpectralIndex, spectral_index
from optopad.design.spec import Emitters, Mold, Receivers, SensorDesign
from optopad.design.spec.layout import FLOOR, Kind, Placement, expand

SECTIONS: dict[str, Kind] = {"emitters": "emitter", "receivers": "receiver"}

MEASURED_SOURCE = "measured value given in the design"
AIR_GAP = Quantity(value=1.0, unit="1", source="air, by definition of an air gap", confidence="read")
ADDED_UNITS = {"emitter": {"radiant_power_mw": "mW"}, "receiver": {"epoxy_index": "1"}}
"""Units of values that a measurement may add to a part whose catalogue entry lacks them."""


@once
def entries_of(design: SensorDesign) -> CatalogEntries:
    """The packaged catalogue with the design's own entries, which take precedence."""
    return catalog.merged(catalog.packaged(), design.catalog)


def part_of(design: SensorDesign, part_id: str, kind: Kind) -> Part:
    """A catalogue part with the design's measured values in place of the catalogue's.

    Raises
    ------
    DesignError : the part is unknown, is of the other kind (emitter or receiver), or has a measured value for an
        unknown field.
    """
    part = catalog.find_part(entries_of(design), part_id, kind)
    values = design.part_measurements.get(part_id)
    return _with_measurements(part, part_id, values) if values else part


def _with_measurements(part: Part, part_id: str, values: Mapping[str, float]) -> Part:
    known = {name: quantity.unit for name, quantity in quantities_of(part).items()} | ADDED_UNITS[part.kind]
    for field in values:
        if field not in known:
            raise DesignError(
                f"part_measurements.{part_id}.{field}: {part_id} has no such value; "
                f"{sheet_name_hint(field) or 'it has ' + ', '.join(sorted(known))}"
            )
    changed = {name: _measured(known[name], value) for name, value in values.items()}
    try:
        return Part.model_validate(dict(part) | changed)
    except ValidationError as err:
        first = err.errors(include_url=False)[0]
        field = ".".join([f"part_measurements.{part_id}", *map(str, first["loc"])])
        raise DesignError(f"{field}: {first['msg'].removeprefix('Value error, ')}; measure again") from None


def quantities_of(part: Part) -> dict[str, Quantity]:
    """All values of a part, each with unit and source, by field name."""
    pairs = ((name, getattr(part, name)) for name in type(part).model_fields)
    return {name: value for name, value in pairs if isinstance(value, Quantity)}


def elastomer_of(design: SensorDesign) -> Elastomer:
    """Catalogue entry of a design's clear elastomer."""
    return catalog.find_elastomer(entries_of(design), design.elastomer.material)


def wavelength_um(design: SensorDesign) -> float:
    """Effective wavelength of a design's default emitter [um]; DesignError if its catalogue entry has none."""
    part = _default_emitter(design)
    if part.wavelength_nm is None:
        raise DesignError(f"emitters.part: {design.emitters.part} has no wavelength_nm; add it to the part")
    return part.wavelength_nm.value / NM_PER_UM


def refractive_index(design: SensorDesign) -> Quantity:
    """Refractive index of the clear elastomer for the default emitter's light [-].

    It is the measured value if there is one, else the mean over the emitter's spectrum or the value at its wavelength.
    """
    own = design.elastomer.refractive_index
    if own is not None:
        return _measured("1", own)
    spectral = elastomer_spectral_index(design)
    return _index_at(design, wavelength_um(design)) if spectral is None else spectral.mean


def elastomer_spectral_index(design: SensorDesign) -> SpectralIndex | None:
    """Refractive index of the clear elastomer, averaged over the default emitter's spectrum, or None without one.

    Raises
    ------
    DesignError : the elastomer's tables do not cover a wavelength of the spectrum.
    """
    spectrum = _default_emitter(design).spectrum
    if spectrum is None:
        return None
    return spectral_index(spectrum, lambda at_um: _index_at(design, at_um))


def _index_at(design: SensorDesign, at_um: float) -> Quantity:
    return catalog.refractive_index(elastomer_of(design), design.elastomer.mixing_ratio, at_um)


def _default_emitter(design: SensorDesign) -> Part:
    return part_of(design, design.emitters.part, "emitter")


def wall_index(design: SensorDesign) -> Quantity | None:
    """Refractive index of the material behind smooth walls [-]; None for walls that reflect diffusely.

    Raises
    ------
    DesignError : the walls are glossy, but neither the design nor the mold's material has an index.
    """
    surfaces = design.surfaces
    if surfaces.wall_finish == "diffuse":
        return None
    if surfaces.wall_finish == "air_gap":
        return AIR_GAP
    if surfaces.wall_index is not None:
        return _measured("1", surfaces.wall_index)
    index = catalog.find_mold_material(entries_of(design), design.mold.material).refractive_index
    if index is None:
        raise DesignError(
            f"surfaces.wall_index: mold.material {design.mold.material} has no refractive_index, which "
            "surfaces.wall_finish = 'glossy' needs; give surfaces.wall_index, or add it to the material"
        )
    return index


def absorption_db_per_cm(design: SensorDesign) -> Quantity:
    """Absorption coefficient of the clear elastomer [dB/cm]."""
    own = design.elastomer.absorption_db_per_cm
    return elastomer_of(design).absorption_db_per_cm if own is None else _measured("dB/cm", own)


def modulus(design: SensorDesign) -> Quantity:
    """Young's modulus of the elastomer [MPa], with source and confidence."""
    own = design.elastomer.youngs_modulus_mpa
    if own is not None:
        return _measured("MPa", own)
    return catalog.youngs_modulus_mpa(elastomer_of(design), design.elastomer.mixing_ratio)


def youngs_modulus_mpa(design: SensorDesign) -> float:
    """Young's modulus of the elastomer [MPa]."""
    return modulus(design).value


def emitter_order(part: Part) -> float:
    """Lambertian order m of an emitter's intensity cos^m [-]."""
    return lambertian_order(part.half_angle_deg.value)


@dataclass(frozen=True, kw_only=True)
class UsedValue:
    """A value on which the verdict about a design depends.

    Attributes
    ----------
    path : dotted path of the design's field that sets the value or a measurement of it
    quantity : value, unit, source, confidence and band
    """

    path: str
    quantity: Quantity

    @property
    def is_open(self) -> bool:
        """Whether the value is neither measured nor read from a source."""
        return self.quantity.confidence in ("inferred", "unverified")


def used_values(design: SensorDesign) -> tuple[UsedValue, ...]:
    """All values that the optical verdict depends on: fields with a band, and properties of parts and elastomer."""
    found = [
        UsedValue(path=path, quantity=_design_quantity(design, path, band))
        for path, band in _bands_in_use(design).items()
    ]
    standing = {
        (place.part or _section(design, place.kind).part, place.kind)
        for place in _placements(design)
        if place.wall == FLOOR and place.height_mm is None
    }
    for part_id, kind in _parts_in_use(design):
        found += _values_of_part(part_of(design, part_id, kind), part_id)
        if (part_id, kind) in standing:
            depth = quantities_of(part_of(design, part_id, kind))["body_depth_mm"]
            found.append(UsedValue(path=f"part_measurements.{part_id}.body_depth_mm", quantity=depth))
        if not isinstance(design.gain.feedback_ohm, str):
            found += _values_of_gain(part_of(design, part_id, kind), part_id)
    if design.surfaces.wall_finish == "glossy" and (behind := wall_index(design)) is not None:
        found.append(UsedValue(path="surfaces.wall_index", quantity=behind))
    skin = skin_of(design)
    if skin is not None:
        found.append(UsedValue(path="top.reflectance", quantity=skin.reflectance))
    found.append(UsedValue(path="elastomer.refractive_index", quantity=refractive_index(design)))
    found.append(UsedValue(path="elastomer.absorption_db_per_cm", quantity=absorption_db_per_cm(design)))
    return tuple(found)


def _values_of_gain(part: Part, part_id: str) -> list[UsedValue]:
    """Emitted power or responsivity of a part, if known; the verdict needs them only for a gain in ohms."""
    name = "radiant_power_mw" if part.kind == "emitter" else "responsivity_a_per_w"
    quantity = quantities_of(part).get(name)
    return (
        [] if quantity is None else [UsedValue(path=f"part_measurements.{part_id}.{name}", quantity=quantity)]
    )


def _values_of_part(part: Part, part_id: str) -> list[UsedValue]:
    """Sizes and angular values of a part on which the verdict depends.

    A receiver without epoxy has no angular values because it is equally sensitive at every angle.
    """
    names = ["active_width_mm", "active_height_mm"]
    table_name = "angular_pattern" if part.kind == "emitter" else "angular_response"
    table = part.angular_pattern if part.kind == "emitter" else part.angular_response
    if part.epoxy_index is not None:
        names.append("epoxy_index")
    if table is None and (part.kind == "emitter" or part.epoxy_index is not None):
        names.append("half_angle_deg")
    quantities = quantities_of(part)
    found = [
        UsedValue(path=f"part_measurements.{part_id}.{name}", quantity=quantities[name]) for name in names
    ]
    if table is not None:
        half = Quantity(
            value=table.half_angle_deg(), unit="deg", source=table.source, confidence=table.confidence
        )
        found.append(UsedValue(path=f"catalog.parts.{part_id}.{table_name}", quantity=half))
    return found


def _parts_in_use(design: SensorDesign) -> tuple[tuple[str, Kind], ...]:
    """Distinct catalogue identifiers and kinds of the parts in a layout, in the order of their first use."""
    return tuple(
        dict.fromkeys(
            (place.part or _section(design, place.kind).part, place.kind) for place in _placements(design)
        )
    )


def _bands_in_use(design: SensorDesign) -> dict[str, Band]:
    """Bands of the design's fields by dotted path, for the fields that the layout uses.

    A layout entry with its own height has the same band as the default height of all emitters or receivers. A part that
    stands on the board has no height to set.
    """
    bands = dict(_bands())
    of_board = bands.pop("board")
    if design.cavity.black_thickness_mm == 0.0 and any(place.wall == FLOOR for place in _placements(design)):
        bands["surfaces.bottom_reflectance"] = of_board
    for section, kind in SECTIONS.items():
        band = bands.pop(f"{section}.height_mm")
        for place in _placements(design):
            if place.kind == kind and (place.wall != FLOOR or place.height_mm is not None):
                own = f"{place.origin}.height_mm"
                bands[f"{section}.height_mm" if place.height_mm is None else own] = band
    return bands


def _placements(design: SensorDesign) -> tuple[Placement, ...]:
    return expand(design.layout, design.cavity)


def _section(design: SensorDesign, kind: Kind) -> Emitters | Receivers:
    return design.emitters if kind == "emitter" else design.receivers


@dataclass(frozen=True, kw_only=True)
class Band:
    """How far a field of the design may deviate on the manufactured unit: `minus` below and `plus` above its value."""

    minus: float
    plus: float
    unit: str
    source: str
    confidence: Confidence


@cache
def _bands() -> dict[str, Band]:
    return {path: Band(**row) for path, row in data_table("bands.toml").items()}


def _design_quantity(design: SensorDesign, path: str, band: Band) -> Quantity:
    value = float(get_at(design.model_dump(mode="json"), path))
    if path in design.measured:
        return Quantity(value=value, unit=band.unit, source=MEASURED_SOURCE, confidence="measured")
    return Quantity(
        value=value,
        unit=band.unit,
        source=band.source,
        confidence=band.confidence,
        low=max(value - band.minus, 0.0),
        high=value + band.plus,
    )


def _measured(unit: str, value: float) -> Quantity:
    return Quantity(value=value, unit=unit, source=MEASURED_SOURCE, confidence="measured")


def fit(name: str) -> Quantity:
    """A length [mm] from the file `design/data/fits.toml`, by its name."""
    return data_quantities("fits.toml")[name]


def clearance_mm(mold: Mold, part_id: str) -> float:
    """Gap on each side of a part's body [mm]: from its fit class, or else the mold's `part_clearance_mm`."""
    named = mold.fits.get(part_id)
    return mold.part_clearance_mm if named is None else fit(named).value


def fit_name(mold: Mold, part_id: str) -> str:
    """Name of a part's fit class; "own clearance" for a part without a fit class."""
    return mold.fits.get(part_id, "own clearance")


# Fields that are cheap to change before manufacture: score and search vary them to find better designs.
HEIGHTS = ("emitters.height_mm", "receivers.height_mm")
CLEAR = "cavity.clear_thickness_mm"
TARGET = "gain.target_counts"
ALONG = ("pitch_mm", "shift_mm")
"""Fields of a layout pattern that set the positions of parts along their wall."""


def cheap_fields(design: SensorDesign) -> tuple[str, ...]:
    """Dotted paths of the cheap fields of a design.

    These are part heights, the clear layer's thickness, the gain's target, and the pitch and shift of layout patterns.
    """
    by_rule = (TARGET,) if isinstance(design.gain.feedback_ohm, str) else ()
    along = (
        f"layout.{number}.{name}"
        for number, pattern in enumerate(design.layout)
        for name in ALONG
        if getattr(pattern, name, None) is not None
    )
    in_walls = {place.kind for place in _placements(design) if place.wall != FLOOR}
    heights = (f"{section}.height_mm" for section, kind in SECTIONS.items() if kind in in_walls)
    return *heights, CLEAR, *by_rule, *along


@dataclass(frozen=True, kw_only=True)
class SkinUse:
    """The skin on a design's top: the catalogue's values, or the design's own in their place.

    Attributes
    ----------
    finish : diffuse (scatters in all directions) or specular (mirrors)
    reflectance : share of the emitters' light that it returns, at any angle [-]
    thickness_mm, youngs_modulus_mpa : its thickness [mm] and Young's modulus [MPa]; None where not given
    """

    finish: str
    reflectance: Quantity
    thickness_mm: Quantity | None
    youngs_modulus_mpa: Quantity | None


def skin_of(design: SensorDesign) -> SkinUse | None:
    """The skin on a design's top; None for a bare one.

    Raises
    ------
    DesignError : the skin is not in the catalogue, or its table does not reach the emitters' wavelength.
    """
    top = design.top
    if top is None:
        return None
    named = None if top.skin is None else catalog.find_skin(entries_of(design), top.skin)
    own = {
        name: _measured(unit, value)
        for name, unit in (("reflectance", "1"), ("thickness_mm", "mm"), ("youngs_modulus_mpa", "MPa"))
        if (value := getattr(top, name)) is not None
    }
    if named is not None and "reflectance" not in own:
        own["reflectance"] = named.reflectance_at(NM_PER_UM * wavelength_um(design))
    finish = top.finish or (None if named is None else named.finish)
    assert finish is not None  # the schema requires it without a name
    return SkinUse(
        finish=finish,
        reflectance=own["reflectance"],
        thickness_mm=own.get("thickness_mm", None if named is None else named.thickness_mm),
        youngs_modulus_mpa=own.get("youngs_modulus_mpa", None if named is None else named.youngs_modulus_mpa),
    )
