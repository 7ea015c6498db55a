"""The build sheet: instructions for printing the mold and casting a design's pad, with the design's own numbers.

Its text is in `templates/casting.md.j2`. Every number comes from the design, the catalogue or
`design/data/assumptions.toml`. Values without a source are marked with a star. Among them are the degassing times and
the proportion of carbon black.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from optopad.design.circuit.circuit import Circuit
from optopad.design.circuit.emitter_switch import current_sink, emitter_switch, most_drive_ma
from optopad.design.circuit.transimpedance import (
    Feedback,
    counts_per_flux_per_ohm,
    settling_findings,
)
from optopad.design.draft import Draft
from optopad.design.fields.base import get_at
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.mold.outline import is_levelled, outline_of
from optopad.design.mold.webs import bodies_above_rim, pockets_below_clear_layer
from optopad.design.parts.assumptions import assumption, ohm_text
from optopad.design.parts.catalog import find_mold_material, find_skin
from optopad.design.preset import true_description
from optopad.design.rules.mold import is_inhibited
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of, facing_pairs
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import (
    clearance_mm,
    elastomer_of,
    entries_of,
    fit_name,
    quantities_of,
    skin_of,
)
from optopad.fabrication.connections import polarity_of
from optopad.fabrication.gain import SimulatedGain, clipped_pairs, feedbacks_for
from optopad.fabrication.sheets.bom import BomRow, bom_rows
from optopad.fabrication.sheets.prices import bill_sum
from optopad.fabrication.sheets.schematic_svg import amplifiers_ma, current_of, supply_words
from optopad.fabrication.sheets.silicone import pours
from optopad.fabrication.sheets.template import filled

MEASURED_FIELDS = ("body_width_mm", "body_depth_mm", "body_height_mm", "active_height_in_body_mm")
"""Names of the part dimensions that determine the size of a part's socket in the wall."""
HANDS_MINUTES = 20
"""Assumed time to weigh, stir and pour one layer [min]."""
COVER_PLAY_MM = 0.6
"""Clearance between a glass cover and its seat [mm]; printed openings may be too small by up to this value."""


def casting_md(
    design: SensorDesign, gain: SimulatedGain | None = None, rows: Sequence[BomRow] | None = None
) -> str:
    """The build sheet (instructions for printing the mold and casting the pad) as Markdown.

    Parameters
    ----------
    gain : simulated gain from light to counts; if None, values that depend on it are not given
    rows : bill of materials with prices; if None, it is the design's own

    Raises
    ------
    DesignError : the catalogue does not have a part or material.
    """
    rows = bom_rows(design, gain) if rows is None else rows
    values = {
        "design": design,
        "description": true_description(design),
        "bought": [row for row in rows if row.is_bought],
        "total": bill_sum(rows),
        **_casting(design),
        **_emitters(Circuit.of(design), gain),
        **_gain(Circuit.of(design), gain),
    }
    return filled("optopad.fabrication.sheets", "casting.md.j2", values).rstrip() + "\n"


def _casting(design: SensorDesign) -> dict[str, Any]:
    cavity, elastomer, layers = cavity_of(design), elastomer_of(design), pours(design)
    size, ledge = design.cavity, design.mold.cover_ledge_mm
    one_of_each = {part.part_id: part for part in reversed(cavity.parts)}
    return {
        "cavity": cavity,
        "elastomer": elastomer,
        "pours": layers,
        "outline": outline_of(design),
        "assumption": assumption,
        "material": find_mold_material(entries_of(design), design.mold.material),
        "measured_parts": {
            part_id: {name: quantities_of(part.part)[name] for name in MEASURED_FIELDS}
            for part_id, part in reversed(one_of_each.items())
        },
        "kinds": _kinds(design, cavity.parts),
        "under_lid": is_cast_under_lid(cavity.plan),
        "is_levelled": is_levelled(design),
        **_board(design, cavity),
        **_skin(design),
        "low_pockets": pockets_below_clear_layer(outline_of(design)),
        "above_rim": bodies_above_rim(outline_of(design)),
        "cover_mm": [side + 2 * ledge - COVER_PLAY_MM for side in (size.length_mm, size.width_mm)],
        "hands_minutes": len(layers) * (HANDS_MINUTES + assumption("degas_minutes").value),
        "coldest": min(elastomer.cure, key=lambda way: way.temperature_c, default=None),
        "is_inhibited": is_inhibited(Draft(design)),
        "heights": {
            part.height_field: get_at(design.model_dump(mode="json"), part.height_field)
            for part in cavity.parts
        },
    }


def _board(design: SensorDesign, cavity: CavityGeometry) -> dict[str, Any]:
    """Parts on the circuit board that need care in casting, and the least height of a face above the black layer."""
    bottom, floor = -design.cavity.black_thickness_mm, cavity.on_floor
    standing = [part for part in floor if part.body_top_mm > ROUNDING_MM]
    return {
        "raised": [part.name for part in floor if part.body_base_mm > bottom + ROUNDING_MM],
        "leaning": [part.name for part in floor if part.is_leaning],
        "standing": [part.name for part in standing],
        "standing_mm": min((part.height_mm for part in standing), default=0.0),
    }


def _skin(design: SensorDesign) -> dict[str, Any]:
    """The skin on the top, and its name; None for a bare top."""
    if design.top is None:
        return {"skin": None}
    named = None if design.top.skin is None else find_skin(entries_of(design), design.top.skin).title
    return {"skin": skin_of(design), "skin_title": named or "the skin of the design"}


def _kinds(design: SensorDesign, parts: Sequence[PlacedPart]) -> list[dict[str, Any]]:
    """Parts of one type and height, with the names of all of them."""
    groups: dict[tuple[str, float], list[PlacedPart]] = {}
    for part in parts:
        groups.setdefault((part.part_id, part.height_mm), []).append(part)
    return [
        {
            "part": same[0],
            "names": " ".join(part.name for part in same),
            "fit": fit_name(design.mold, part_id),
            "clearance_mm": clearance_mm(design.mold, part_id),
            "polarity": polarity_of(same[0], Circuit.of(design)),
        }
        for (part_id, _), same in groups.items()
    ]


def _emitters(circuit: Circuit, gain: SimulatedGain | None) -> dict[str, Any]:
    current = current_of(circuit, gain)
    pin, most_pin_ma = most_drive_ma(circuit)
    return {
        "sink": current_sink(circuit),
        "driver": circuit.led_driver,
        "switches": {one.part_id: emitter_switch(one.part, circuit.board) for one in circuit.cavity.emitters},
        "pin": pin,
        "most_pin_ma": most_pin_ma,
        "current": current,
        "amplifiers": f"{amplifiers_ma(current)}{'' if current.is_amplifier_known else '*'}",
        "supply": supply_words(circuit),
    }


def _gain(circuit: Circuit, gain: SimulatedGain | None) -> dict[str, Any]:
    design, cavity, feedbacks = circuit.design, circuit.cavity, feedbacks_for(circuit, gain)
    alike: dict[tuple[str, ...], list[str]] = {}
    for part, one in zip(cavity.receivers, feedbacks or (), strict=feedbacks is not None):
        alike.setdefault(_fitted(one), []).append(part.name)
    return {
        "feedbacks": None if feedbacks is None else alike,
        "per_ohm": counts_per_flux_per_ohm(circuit),
        "settling": list(settling_findings(circuit, None if gain is None else gain.counts_per_flux)),
        "is_facing_rows": bool(facing_pairs(cavity)),
        "clipped": None if gain is None else clipped_pairs(design, gain),
        "pair_count": len(cavity.emitters) * len(cavity.receivers),
        "full_scale": round(Circuit.of(design).adc.full_scale_counts),
    }


def _fitted(one: Feedback) -> tuple[str, ...]:
    """What the sheet's table says of a receiver's amplifier; receivers with equal cells share a row."""
    exact, low, high = (ohm_text(float(f"{ohm:.3g}")) for ohm in (one.exact_ohm, one.low_ohm, one.high_ohm))
    late = "" if one.is_in_time else " (too slow)"
    return (
        exact,
        f"{low} to {high}",
        ohm_text(one.standard_ohm),
        f"{one.gain_factor - 1:+.1%}",
        f"{one.capacitor_pf:g} pF",
        f"{one.settles_us:.1f}{late}",
    )
