"""The build sheet: instructions for printing the mold and casting a design's pad, with the design's own numbers.

Every number comes from the design, the catalogue or `design/data/assumptions.toml`. Values without a source are marked
with a star. Among them are the degassing times and the proportion of carbon black.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from optopad.design.circuit.circuit import Circuit
from optopad.design.draft import Draft
from optopad.design.fields.quantity import Quantity
from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.mold.outline import outline_of
from optopad.design.mold.webs import bodies_above_rim, pockets_below_clear_layer
from optopad.design.parts.assumptions import assumption
from optopad.design.parts.catalog import find_mold_material
from optopad.design.parts.elastomer import Cure
from optopad.design.preset import true_description
from optopad.design.rules.mold import is_inhibited
from optopad.design.shape.cavity import CavityGeometry, PlacedPart, cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.fits import clearance_mm, fit_name
from optopad.design.spec.properties import elastomer_of, entries_of, quantities_of
from optopad.fabrication.connections import polarity_of
from optopad.fabrication.gain import SimulatedGain
from optopad.fabrication.sheets.bom import BomRow, bom_rows
from optopad.fabrication.sheets.buy_sheet import buy_lines
from optopad.fabrication.sheets.gain_sheet import gain_lines
from optopad.fabrication.sheets.schematic_svg import circuit_lines
from optopad.fabrication.sheets.silicone import pours
from optopad.fabrication.sheets.table import number, plain, size_words

MEASURED_FIELDS = ("body_width_mm", "body_depth_mm", "body_height_mm", "active_height_in_body_mm")
"""Names of the part dimensions that determine the size of a part's socket in the wall."""

OPEN = ("inferred", "unverified")
"""Confidence ratings of catalogue values that the casting instructions ask the user to measure."""

HOURS_FROM_MINUTES = 120
"""Shortest cure time that is printed in hours [min]; shorter ones are printed in minutes."""

MINUTES_PER_HOUR = 60

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
    cavity = cavity_of(design)
    sections = (
        _heading(design),
        buy_lines(bom_rows(design, gain) if rows is None else rows),
        _weights(design),
        _measure_first(cavity),
        _print(design, cavity),
        _fit(design, cavity),
        _cast(design, cavity),
        _cure(design),
        _measure_after(design, cavity),
        circuit_lines(design, gain),
        gain_lines(design, gain),
    )
    return "\n".join(line for section in sections for line in section).rstrip() + "\n"


def _heading(design: SensorDesign) -> Iterator[str]:
    yield f"# Casting {design.name}"
    yield ""
    if described := true_description(design):
        yield plain(described)
        yield ""
    yield f"Design digest {design.digest}. Lengths in mm. A star marks an unverified value."
    yield ""


def _weights(design: SensorDesign) -> Iterator[str]:
    elastomer, ratio = elastomer_of(design), design.elastomer.mixing_ratio
    density, waste = elastomer.density_g_per_cm3, assumption("silicone_waste")
    yield "## Weigh"
    yield ""
    yield f"{plain(elastomer.title)}, base to curing agent {number(ratio)} : 1 by weight."
    yield ""
    yield "| layer | thickness mm | in the mold g | to use g | to mix g | base g | curing agent g | carbon black g |"
    yield "|---|---|---|---|---|---|---|---|"
    for pour in pours(design):
        grams = (pour.net_g, pour.used_g, pour.mixed_g, pour.base_g, pour.agent_g)
        carbon = f"{pour.carbon_g:.2f}*" if pour.carbon_g else ""
        row = " | ".join([*(f"{gram:.2f}" for gram in grams), carbon])
        yield f"| {pour.layer} | {number(pour.thickness_mm)} | {row} |"
    yield ""
    yield f"Density {_shown(density)}; {waste.value:.0%}* is added for residue in the cup and in the gaps."
    yield from _too_little(design)
    if design.cavity.black_thickness_mm > 0:
        share = assumption("carbon_black_share")
        yield (
            f"Carbon black: {share.value:.0%}* by weight (from {share.low:.0%} to {share.high:.0%}); the "
            "paper adds it to saturation and states no share."
        )
    yield ""


def _too_little(design: SensorDesign) -> Iterator[str]:
    step = assumption("scale_step").value
    for pour in pours(design):
        if pour.is_larger_batch:
            yield (
                f"Less than {pour.agent_g:.2f} g of curing agent are too little for a scale of {step:g}* g: mix "
                f"{pour.mixed_g:.2f} g for the {pour.layer} layer and use {pour.used_g:.2f} g of it."
            )


def _measure_first(cavity: CavityGeometry) -> Iterator[str]:
    yield "## Measure before printing"
    yield ""
    yield "The sockets are cut from these lengths. Measure your parts with a calliper, the chip height under a loupe"
    yield "or on a photograph with a scale, and enter values that differ in the design under"
    yield "`[part_measurements.<part>]`, for example `active_height_in_body_mm = 3.4`; then run the design again."
    yield ""
    yield "| part | length | mm | confidence | measure |"
    yield "|---|---|---|---|---|"
    for part in _one_of_each(cavity.parts):
        known = quantities_of(part.part)
        for name in MEASURED_FIELDS:
            must = "yes" if known[name].confidence in OPEN else ""
            yield f"| {part.part_id} | {name} | {number(known[name].value)} | {known[name].confidence} | {must} |"
    yield ""


def _print(design: SensorDesign, cavity: CavityGeometry) -> Iterator[str]:
    material, outline = find_mold_material(entries_of(design), design.mold.material), outline_of(design)
    outside, inside = size_words(outline.outer), size_words(cavity.plan.outline)
    depth = outline.top_mm - outline.cavity_bottom_mm
    yield "## Print and check"
    yield ""
    yield f"Print in {plain(material.title)}, without support, each part in the orientation of its file:"
    yield ""
    yield "| file | purpose |"
    yield "|---|---|"
    yield from (f"| `cad/{name}` | {use} |" for name, use in _printed(design, cavity))
    yield ""
    yield f"1. Measure the mold: outside {outside}, cavity {inside},"
    yield f"   from rim to cavity floor {number(depth)}."
    yield "2. Clean the sockets; the active faces must sit flush with the cavity's walls."
    if outline.numbers:
        corner = "; the cut corner is the origin of x and y" if cavity.plan.has_origin_corner else ""
        yield f"3. The names in the outer faces are those of `wiring.csv`{corner}."
    yield ""
    for note in material.notes:
        yield f"- {plain(note)}"
    yield ""


def _printed(design: SensorDesign, cavity: CavityGeometry) -> Iterator[tuple[str, str]]:
    if design.mold.pieces == "one":
        yield "mold.stl", "the mold, open side up"
    else:
        yield (
            "mold_frame.stl",
            "walls and sockets; screwed to the base through the fixing holes, the joint taped",
        )
        yield "mold_base.stl", "cavity floor; removed to push the pad out and cast again"
    if is_cast_under_lid(cavity.plan):
        yield (
            "lid.stl",
            "shapes the crown; its pins are in the fixing holes; print it on its back, in layers of 0.1 mm",
        )
    else:
        if cavity.black_mm > 0:
            yield "leveling_blade.stl", f"leaves {number(cavity.black_mm)} of black layer"
        if design.mold.rim_mm > 0:
            yield (
                "pour_gauge.stl",
                f"its middle tooth ends {number(design.mold.rim_mm)} below the rim, at the clear layer's top",
            )
    yield "solder_jig.stl", "holds a part of each kind while its wires are soldered at the sockets' pitch"
    yield "indenter_tip.stl", "the tip of the presses, with its shank"


def _fit(design: SensorDesign, cavity: CavityGeometry) -> Iterator[str]:
    yield "## Fit the parts"
    yield ""
    yield (
        "Positions and pins: `wiring.svg`, `wiring.csv`; parts in sockets: `orientation.svg`; circuit: "
        "`schematic.svg`."
    )
    yield "Insert every part from above, active face inward."
    yield ""
    yield "| part | references | base above black layer | fit, gap at each side | leads | polarity |"
    yield "|---|---|---|---|---|---|"
    circuit = Circuit.of(design)
    for group in _groups(cavity.parts):
        first = group[0]
        leads = "down through the floor" if first.part.mounting == "radial" else "out through the wall's back"
        names = " ".join(part.name for part in group)
        fitted = f"{fit_name(design.mold, first.part_id)}, {clearance_mm(design.mold, first.part_id):.2f}"
        row = f"{first.part_id} | {names} | {first.body_base_mm:.2f} | {fitted} | {leads}"
        yield f"| {row} | {polarity_of(first, circuit)} |"
    yield ""
    yield "1. Solder wires to surface parts first, in the solder jig; test every part before it is cast in."
    yield "2. Seat each body on the floor of its socket: that sets its height."
    yield "3. Press wires into the necks of their slots; sleeve leads and bend them into the channel below the mold."
    yield "   Seal every lead hole and wire slot from outside, and the gaps around the bodies."
    below = pockets_below_clear_layer(outline_of(design))
    if below and cavity.black_mm > 0:
        yield f"4. The sockets of {' '.join(below)} reach below the clear layer: keep black silicone off their faces."
    yield ""


def _cast(design: SensorDesign, cavity: CavityGeometry) -> Iterator[str]:
    yield "## Cast"
    yield ""
    under_lid = is_cast_under_lid(cavity.plan)
    steps = (
        _crowned_steps(design, cavity)
        if under_lid
        else [*_black_steps(design, cavity), *_clear_steps(design, cavity)]
    )
    yield _duration_of_all(design)
    yield ""
    yield from (f"{place}. {step}" for place, step in enumerate(steps, start=1))
    yield ""
    yield "Warnings:"
    yield ""
    if is_inhibited(Draft(design)):
        yield "- This mold is printed in resin, which may inhibit the cure: the silicone stays tacky. Wash it,"
        yield "  post-cure it, coat it, and try some silicone on it before you cast."
    else:
        yield "- Keep to this material: the uncured resin of an SLA print inhibits the cure."
    if under_lid:
        yield "- Layer lines of the lid copy into the crown, as haze: smooth its dish, or lay a formed film into it."
    else:
        yield "- Layer lines of a print copy into silicone: never cast the optical face against printed plastic."
    for note in elastomer_of(design).notes:
        yield f"- {plain(note)}"
    yield ""


def _crowned_steps(design: SensorDesign, cavity: CavityGeometry) -> list[str]:
    """Casting steps for a pad with a convex top, which is cast upside down and filled through the floor."""
    clear, *black = pours(design)
    where = f"{number(cavity.black_mm)} below the floor" if black else "in all narrow holes"
    steps = [
        "Tack every body in its socket with a drop of silicone, let it cure, and check that none moves "
        "when the mold is inverted: nothing else holds them at their heights.",
        "Set the mold on its lid, pins in the fixing holes, floor up; clamp, and seal the seam from outside.",
        f"Clear layer: mix {clear.base_g:.2f} g base and {clear.agent_g:.2f} g curing agent; degas {_degassing()}.",
        f"Inject {clear.net_g:.2f} g through the wide hole of the floor, on a scale, slowly: its level is "
        f"then {where}. Degas again, tilt so that bubbles leave by the narrow holes, cure level (below).",
    ]
    for pour in black:
        steps.append(
            f"Black layer: mix {pour.base_g:.2f} g base and {pour.agent_g:.2f} g curing agent, stir in "
            f"{pour.carbon_g:.2f}* g of carbon black; degas {_degassing()}. Inject until it is visible in "
            "all narrow holes; cure."
        )
    return [
        *steps,
        "Cut off the silicone that protrudes from the holes, invert the mold, and lift the lid off at its notches.",
    ]


def _black_steps(design: SensorDesign, cavity: CavityGeometry) -> Iterator[str]:
    for pour in pours(design):
        if pour.layer == "black":
            yield (
                f"Black layer: mix {pour.base_g:.2f} g base and {pour.agent_g:.2f} g curing agent, stir "
                f"in {pour.carbon_g:.2f}* g of carbon black, or as much as still lets it flow; degas "
                f"{_degassing()}. Pour."
            )
            yield _leveling(design)
            yield f"Cure it (below). It must be {number(cavity.black_mm)} thick, level, and black to the walls."


def _clear_steps(design: SensorDesign, cavity: CavityGeometry) -> Iterator[str]:
    clear = next(pour for pour in pours(design) if pour.layer == "clear")
    bottom = "the black layer" if cavity.black_mm > 0 else "the cavity's floor"
    yield (
        f"Clear layer: mix {clear.base_g:.2f} g base and {clear.agent_g:.2f} g curing agent; degas {_degassing()}. "
        f"All of it must be poured within {number(assumption('pot_life_minutes').value)}* min of mixing."
    )
    gauge = "until the middle tooth of the pour gauge is wet: " if design.mold.rim_mm > 0 else ""
    yield (
        f"Pour slowly against one wall {gauge}to {number(cavity.clear_mm)} above {bottom}, which is "
        f"{number(design.mold.rim_mm)} below the rim; degas again, prick bubbles at the active faces."
    )
    if design.mold.cover_ledge_mm:
        yield _cover(design)
    else:
        yield "Level the mold, cover it against dust, cure. The open surface is the optical face: do not touch it."
    if design.mold.pieces == "frame_and_base":
        yield (
            "Loosen the screws, lift the frame off the base, and free the pad's underside; the base "
            "can be used again."
        )


def _cover(design: SensorDesign) -> str:
    size, ledge = design.cavity, design.mold.cover_ledge_mm
    length, width = (side + 2 * ledge - COVER_PLAY_MM for side in (size.length_mm, size.width_mm))
    return (
        f"Pour a little over the seat. Lower a clean glass of {number(length)} x {number(width)} from one edge onto "
        "it, without bubbles; the displaced silicone runs into the sockets. Cure level. The face against the glass "
        "is the optical face: it comes out smooth, and the glass slides off sideways."
    )


def _degassing() -> str:
    minutes = assumption("degas_minutes")
    return (
        f"about {number(minutes.value)}* min ({number(minutes.low or 0)} to {number(minutes.high or 0)}) under vacuum, "
        "50 mbar* or below, until no bubbles rise"
    )


def _duration_of_all(design: SensorDesign) -> str:
    cure = min(elastomer_of(design).cure, key=lambda way: way.temperature_c, default=None)
    layers = len(pours(design))
    hands = layers * (HANDS_MINUTES + assumption("degas_minutes").value)
    if cure is None:
        return f"The manual work takes about {number(hands)}* min, in addition to the cure."
    total = number(layers * cure.minutes / MINUTES_PER_HOUR)
    return (
        f"Takes about {number(hands)}* min of work and degassing, and {total} h of cure at "
        f"{number(cure.temperature_c)} C ({layers} layers, the first only until it no longer sticks); warmer is faster."
    )


def _leveling(design: SensorDesign) -> str:
    above = bodies_above_rim(outline_of(design))
    if above:
        return (
            f"{' '.join(above)} protrude above the rim, in the path of the leveling blade: level between "
            "them by hand, or raise `mold.rim_mm`."
        )
    is_round = plan_of(design).outline.dimensions[0].is_diameter
    way = "rotate it by half a turn around its middle" if is_round else "draw it once along the longer side"
    return f"Rest the leveling blade on the rim and {way}; wipe off the excess."


def _cure(design: SensorDesign) -> Iterator[str]:
    elastomer = elastomer_of(design)
    yield "## Cure"
    yield ""
    if not elastomer.cure:
        yield f"The catalogue has no cure times for {plain(elastomer.title)}: take the maker's."
        yield ""
        return
    yield "The lowest temperature is safe: higher ones must stay below the limit of the printed mold (see its notes)."
    yield (
        "Both layers cure in the same way; the black one only until it no longer sticks. A surface "
        "that stays tacky was"
    )
    yield "inhibited: by uncured resin, sulfur (latex gloves, some clays), tin or amines (some epoxies and solder"
    yield "fluxes). Clean the soldered joints, and wear nitrile gloves."
    yield ""
    yield "| temperature C | time | confidence | source |"
    yield "|---|---|---|---|"
    for cure in sorted(elastomer.cure, key=lambda way: way.temperature_c):
        star = "*" if cure.confidence in OPEN else ""
        source = plain(cure.source)
        yield f"| {number(cure.temperature_c)} | {_duration(cure)}{star} | {cure.confidence} | {source} |"
    yield ""


def _measure_after(design: SensorDesign, cavity: CavityGeometry) -> Iterator[str]:
    yield "## Measure after fitting, and update the design"
    yield ""
    if is_cast_under_lid(cavity.plan):
        black = f", less {number(cavity.black_mm)} for the black layer" if cavity.black_mm > 0 else ""
        yield (
            "The signals depend on the heights of the active areas. Before the lid is put on, measure "
            "from the cavity's floor"
        )
        yield f"to the middle of each active area{black}, with a depth gauge or on a level"
    else:
        yield (
            "The verdict depends on the heights of the active areas. Before the clear layer is poured, "
            "with the silicone"
        )
        yield "below it cured, measure from its surface to the middle of each area with a depth gauge or on a level"
    yield "photograph. Enter the mean in the design and its path in `measured`; the verdict then no longer"
    yield "includes their uncertainty bands:"
    yield ""
    heights = {part.height_field: part.height_mm for part in cavity.parts}
    listed = ", ".join(f'"{path}"' for path in heights)
    yield "```toml"
    yield f"measured = [{listed}]"
    yield "```"
    yield ""
    yield "| height | design mm | state |"
    yield "|---|---|---|"
    for path, height in heights.items():
        state = "measured" if path in design.measured else "not measured"
        yield f"| {path} | {number(height)} | {state} |"
    yield ""


def _one_of_each(parts: Sequence[PlacedPart]) -> tuple[PlacedPart, ...]:
    return tuple({part.part_id: part for part in reversed(parts)}.values())[::-1]


def _groups(parts: Sequence[PlacedPart]) -> list[list[PlacedPart]]:
    groups: dict[tuple[str, float], list[PlacedPart]] = {}
    for part in parts:
        groups.setdefault((part.part_id, part.height_mm), []).append(part)
    return list(groups.values())


def _shown(quantity: Quantity) -> str:
    star = "*" if quantity.confidence in OPEN else ""
    return f"{number(quantity.value)}{star} {quantity.unit}"


def _duration(cure: Cure) -> str:
    if cure.minutes >= HOURS_FROM_MINUTES:
        return f"{number(cure.minutes / MINUTES_PER_HOUR)} h"
    return f"{number(cure.minutes)} min"
