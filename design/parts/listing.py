"""Overview of the catalogue: each entry with its main figures, a source, and how many values have each confidence.

The kinds of parts and materials have figures of their own. Entries of any other table show their first numbers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from optopad.design.errors import InputError
from optopad.design.fields.base import Model, nearest
from optopad.design.fields.quantity import CONFIDENCES, Confidence, Quantity
from optopad.design.parts.catalog import Board, CatalogEntries, Elastomer, MoldMaterial, Part
from optopad.design.parts.circuits import Amplifier
from optopad.design.parts.skin import Skin

MOST_FIGURES = 4
_TITLES = {"elastomers": "silicones", "mold_materials": "plastics"}
"""Names of tables of the catalogue in the overview, where they differ."""


@dataclass(frozen=True, kw_only=True)
class Listed:
    """One entry of the catalogue in the overview.

    Attributes
    ----------
    kind : its group, such as emitters or silicones
    name : identifier
    figures : main figures with units
    source : source of most of its values with the highest confidence; of a silicone, of index and modulus
    confidences : number of values by confidence
    """

    kind: str
    name: str
    title: str
    figures: str
    source: str
    confidences: dict[str, int]
    entry: dict[str, Any]


def kinds_of(entries: CatalogEntries) -> tuple[str, ...]:
    """Groups of the overview, in its order."""
    others = [_title(name) for name in type(entries).model_fields if name != "parts"]
    return ("emitters", "receivers", *others)


def listed(entries: CatalogEntries, kind: str | None = None) -> tuple[Listed, ...]:
    """The entries of a catalogue, all or one group, by group and name.

    Raises
    ------
    InputError : there is no such group; the message lists them.
    """
    known = kinds_of(entries)
    if kind is not None:
        plain = kind.strip().lower().replace("_", "-").replace(" ", "-")
        kind = next((one for one in (plain, f"{plain}s", f"{plain}es") if one in known), kind)
    if kind is not None and kind not in known:
        near = nearest(kind, known)
        hint = f"did you mean {near[0]}? " if near else ""
        raise InputError(f"--kind: {kind!r} is refused: {hint}known are {', '.join(known)}")
    found = [_listed(group, name, entry) for group, name, entry in _all(entries)]
    wanted = [one for one in found if kind in (None, one.kind)]
    return tuple(sorted(wanted, key=lambda one: (known.index(one.kind), one.name)))


def _title(table: str) -> str:
    return _TITLES.get(table, table.replace("_", "-"))


def _all(entries: CatalogEntries) -> Iterator[tuple[str, str, Model]]:
    for table in type(entries).model_fields:
        for name, entry in getattr(entries, table).items():
            yield f"{entry.kind}s" if isinstance(entry, Part) else _title(table), name, entry


def _listed(kind: str, name: str, entry: Model) -> Listed:
    figures = next((say for model, say in _FIGURES.items() if isinstance(entry, model)), _first_numbers)
    document = entry.model_dump(mode="json")
    found = list(_sourced(document))
    named = {name: document[name] for name in _SOURCES.get(type(entry), ())} or document
    sources = Counter(_sourced(named))
    counted = Counter(confidence for _, confidence in found)
    return Listed(
        kind=kind,
        name=name,
        title=getattr(entry, "title", name),
        figures=figures(entry),
        source=max(sources, key=lambda one: (-CONFIDENCES.index(one[1]), sources[one]), default=("none",))[0],
        confidences={level: counted[level] for level in CONFIDENCES if counted[level]},
        entry=entry.model_dump(mode="json", exclude_none=True),
    )


def _sourced(document: Any) -> Iterator[tuple[str, Confidence]]:
    """Source and confidence of every value in nested plain data that states both."""
    if isinstance(document, dict):
        if "source" in document and "confidence" in document:
            yield document["source"], document["confidence"]
        for value in document.values():
            yield from _sourced(value)
    elif isinstance(document, list):
        for value in document:
            yield from _sourced(value)


def _part(part: Part) -> str:
    sizes = (part.body_width_mm, part.body_depth_mm, part.body_height_mm)
    body = f"body {' x '.join(f'{size.value:g}' for size in sizes)} mm"
    if part.kind == "emitter":
        power = "" if part.radiant_power_mw is None else f"{_of(part.radiant_power_mw)} at "
        own = f"{_of(part.wavelength_nm)}, half angle {_of(part.half_angle_deg)}, {power}{_of(part.max_current_ma)}"
    else:
        own = (
            f"area {part.active_width_mm.value:g} x {part.active_height_mm.value:g} mm, "
            f"{_of(part.responsivity_a_per_w)} at {_of(part.responsivity_wavelength_nm)}, "
            f"half angle {_of(part.half_angle_deg)}, {_of(part.capacitance_pf)}"
        )
    return f"{own}, {body}"


def _silicone(silicone: Elastomer) -> str:
    ratios = sorted({silicone.mixing_ratio_low, silicone.mixing_ratio_high})
    moduli = sorted({row.modulus_mpa for row in silicone.modulus})
    index = [value for table in silicone.index for value in table.index]
    return (
        f"mixed {_ends(ratios)} : 1, index {_ends([min(index), max(index)])}, modulus {_ends(moduli)} MPa, "
        f"absorption {_of(silicone.absorption_db_per_cm)}"
    )


def _plastic(plastic: MoldMaterial) -> str:
    index = "" if plastic.refractive_index is None else f", index {plastic.refractive_index.value:g}"
    return f"reflectance {plastic.wall_reflectance.value:g}{index}, {_of(plastic.density_g_per_cm3)}"


def _skin(skin: Skin) -> str:
    return (
        f"{skin.finish}, reflectance {_ends(list(skin.reflectance.share))} "
        f"({_ends([*skin.reflectance.low, *skin.reflectance.high])}), {_of(skin.thickness_mm)} thick, "
        f"modulus {_of(skin.youngs_modulus_mpa)}"
    )


def _board(board: Board) -> str:
    link = f"USB {board.usb_bytes_per_s:,} bytes/s" if board.usb_bytes_per_s else "serial"
    return (
        f"{board.adc_bits} bits, {len(board.analog_channels)} inputs, {len(board.digital_pins)} pins, "
        f"pins {board.pin_v:g} V, emitters {board.emitter_v:g} V, {link}"
    )


def _amplifier(amplifier: Amplifier) -> str:
    margin_v, low, high = (
        amplifier.output_margin_mv.value / 1e3,
        amplifier.supply_low_v,
        amplifier.supply_high_v,
    )
    bias = amplifier.bias_current_pa
    most = "" if bias.high is None else f" (at most {bias.high:g})"
    return (
        f"{amplifier.channels} in a package, {low:g} to {high:g} V, {_of(amplifier.bandwidth_mhz)}, "
        f"{_of(amplifier.slew_v_per_us)}, bias {bias.value:g}{most} {bias.unit}, output to {margin_v:g} V below the "
        f"supply, {_of(amplifier.supply_ma)} each"
    )


def _first_numbers(entry: Model) -> str:
    found = []
    for name in type(entry).model_fields:
        value = getattr(entry, name)
        if isinstance(value, Quantity):
            found.append(f"{_spelt(name)} {_of(value)}")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found.append(f"{_spelt(name)} {value:g}" + (" V" if name.endswith("_v") else ""))
    return ", ".join(found[:MOST_FIGURES])


def _spelt(field: str) -> str:
    """A field's name without its unit, in words."""
    stem, _, unit = field.rpartition("_")
    return (stem if stem and unit in ("v", "ma", "us", "mhz", "khz", "ohm", "na", "pf") else field).replace(
        "_", " "
    )


def _of(quantity: Quantity | None) -> str:
    return "unknown" if quantity is None else f"{quantity.value:g} {quantity.unit}"


def _ends(values: list[float]) -> str:
    low, high = f"{min(values):.4g}", f"{max(values):.4g}"
    return low if low == high else f"{low} to {high}"


_SOURCES: dict[type[Model], tuple[str, ...]] = {Elastomer: ("index", "modulus")}
"""Fields whose source is shown, where others have values, too."""
_FIGURES: dict[type[Model], Callable[[Any], str]] = {
    Part: _part,
    Amplifier: _amplifier,
    Elastomer: _silicone,
    MoldMaterial: _plastic,
    Skin: _skin,
    Board: _board,
}
