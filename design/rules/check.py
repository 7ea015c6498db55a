"""Check of a design that reports all errors and warnings at once, and its notes.

The schema (`optopad.design.spec`) checks each field separately. These rules check fields against each other, against
the catalogue, and against the limits of the printer, the board and the models. Unmeasured values are not findings; the
report lists them (`optopad.design.spec.properties.used_values`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial

from optopad.design.draft import Draft
from optopad.design.errors import DesignError, ModelScopeError
from optopad.design.fields.base import leaves, nearest
from optopad.design.fields.finding import NO_VERDICT, OUT_OF_SCOPE, Finding, error, warning
from optopad.design.mold.label import label_findings
from optopad.design.once import once
from optopad.design.parts import catalog
from optopad.design.parts.catalog import CatalogEntries
from optopad.design.parts.circuits import EMITTER_CHIPS, RECEIVER_CHIPS, BoardChip, named_chip
from optopad.design.rules.board import board_findings, circuit_findings
from optopad.design.rules.floor import floor_findings, skin_findings
from optopad.design.rules.light import (
    angle_findings,
    area_findings,
    colour_findings,
    count_findings,
    depth_findings,
    finish_findings,
    material_findings,
    name_findings,
    path_findings,
    workspace_findings,
)
from optopad.design.rules.mold import housing_notes, mold_findings, web_findings
from optopad.design.rules.shape import is_spanned, shape_findings, span_findings
from optopad.design.rules.touch import touch_notes
from optopad.design.shape.cavity import part_field
from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import MAX_PER_KIND, Kind
from optopad.design.spec.properties import part_of
from optopad.design.spec.tolerances import tolerance_findings

__all__ = ["Finding", "check", "notes", "require_scope", "require_valid"]

SMALLEST_LENGTH_MM = 0.01
"""Smallest plausible length: no printer, mold or caliper resolves less, and the value was probably given in metres."""


@once
def check(design: SensorDesign) -> tuple[Finding, ...]:
    """All errors and warnings about a design: errors first, then those of largest weight.

    The rules about locations of parts are left out if the layout has too many: their time grows with the square of the
    number of parts.
    """
    draft = Draft.of(design)
    kinds = [place.kind for place in draft.places]
    counts = kinds.count("emitter"), kinds.count("receiver")
    unknown = part_findings(draft)
    found = [
        *unknown,
        *entry_findings(draft),
        *count_findings(*counts),
        *depth_findings(draft),
        *finish_findings(draft),
        *label_findings(design),
        *_unit_findings(design),
    ]
    circuit = draft.circuit if all(counts) and not any(absent_electronics(draft)) else None
    if circuit is not None:
        found += board_findings(circuit)
    is_placeable = not unknown and max(counts) <= MAX_PER_KIND
    if is_placeable:
        found += span_findings(draft)
    if is_placeable and is_spanned(draft):
        found += tolerance_findings(design)
        found += _geometry_findings(draft, counts)
        found += circuit_findings(circuit) if circuit is not None else ()
    return by_weight(found)


def by_weight(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings in the order in which they are shown: errors first, then those of largest weight."""
    return tuple(sorted(findings, key=lambda finding: (finding.severity != "error", -finding.weight)))


def notes(design: SensorDesign) -> tuple[Finding, ...]:
    """Notes about what a user may not expect or know; the design must have no errors."""
    draft = Draft.of(design)
    return (*touch_notes(draft), *housing_notes(draft))


def require_valid(design: SensorDesign) -> tuple[Finding, ...]:
    """The findings about a design without errors; refuse a design that has errors.

    Raises
    ------
    DesignError : the design has errors; the message lists them, one per line.
    """
    found = check(design)
    errors = [str(finding) for finding in found if finding.severity == "error"]
    if errors:
        raise DesignError(f"{design.name}: not a usable design\n" + "\n".join(f"  {line}" for line in errors))
    return found


def require_scope(design: SensorDesign) -> None:
    """Refuse a design on which the models give no verdict, before anything is computed.

    Raises
    ------
    ModelScopeError : a finding says so; the message has value, limit and way out.
    """
    outside = [str(one) for one in check(design) if one.weight == OUT_OF_SCOPE]
    if outside:
        raise ModelScopeError(outside[0].replace(NO_VERDICT, ""))


def _geometry_findings(draft: Draft, counts: tuple[int, int]) -> Iterator[Finding]:
    cavity = draft.cavity
    if draft.design.elastomer.material in draft.entries.elastomers:
        yield from material_findings(draft)
    yield from colour_findings(draft)
    yield from angle_findings(cavity)
    yield from workspace_findings(draft)
    if all(counts):
        yield from name_findings(cavity)
        yield from path_findings(cavity)
        yield from area_findings(cavity)
        yield from floor_findings(draft)
        yield from skin_findings(draft)
        yield from web_findings(draft)
        yield from mold_findings(draft)
        yield from shape_findings(draft)


def _unit_findings(design: SensorDesign) -> Iterator[Finding]:
    for path, value in leaves(design.model_dump(mode="json", exclude={"catalog", "part_measurements"})):
        if path.endswith("_mm") and isinstance(value, float) and 0 < abs(value) < SMALLEST_LENGTH_MM:
            yield warning(
                path,
                "so short a length cannot be made",
                value=f"{value:g} mm",
                limit=f"0, or at least {SMALLEST_LENGTH_MM:g} mm",
                way_out="lengths are in millimetres: was it given in metres?",
            )


Named = tuple[str, Callable[[CatalogEntries, str], object], str]
"""Field of a design, function that looks up a name in the catalogue, and the name in this field."""


def part_findings(draft: Draft) -> list[Finding]:
    """Errors about parts and measured values that do not exist in the catalogue."""
    return [*_named_findings(draft), *_measurement_findings(draft.design, draft.entries)]


def entry_findings(draft: Draft) -> Iterator[Finding]:
    """Errors about materials, boards and chips that do not exist in the catalogue."""
    design = draft.design
    yield from _absent(
        draft.entries,
        ("elastomer.material", catalog.find_elastomer, design.elastomer.material),
        ("mold.material", catalog.find_mold_material, design.mold.material),
        *((("top.skin", catalog.find_skin, design.top.skin),) if design.top and design.top.skin else ()),
        *_electronics(design),
    )


def absent_electronics(draft: Draft) -> Iterator[Finding]:
    """Errors about a board and chips that do not exist in the catalogue."""
    yield from _absent(draft.entries, *_electronics(draft.design))


def _electronics(design: SensorDesign) -> Iterator[Named]:
    use = design.board
    yield "board.kind", catalog.find_board, use.kind
    for kind in (*RECEIVER_CHIPS, *EMITTER_CHIPS):
        name = named_chip(use, kind)
        if name is not None:
            yield kind.field, partial(_chip, kind), name


def _chip(kind: type[BoardChip], entries: CatalogEntries, name: str) -> object:
    return catalog.find_chip(entries, kind, name)


def _absent(entries: CatalogEntries, *names: Named) -> Iterator[Finding]:
    for field, look_up, name in names:
        try:
            look_up(entries, name)
        except DesignError as err:
            yield _not_found(field, name, err)


def _named_findings(draft: Draft) -> Iterator[Finding]:
    named: dict[tuple[str, str, Kind], None] = {
        ("emitters.part", draft.design.emitters.part, "emitter"): None,
        ("receivers.part", draft.design.receivers.part, "receiver"): None,
    }
    for place in draft.places:
        if place.part is not None:
            named[(part_field(place), place.part, place.kind)] = None
    for field, part_id, kind in named:
        try:
            catalog.find_part(draft.entries, part_id, kind)
        except DesignError as err:
            yield _not_found(field, part_id, err)


def _measurement_findings(design: SensorDesign, entries: CatalogEntries) -> Iterator[Finding]:
    for part_id in design.part_measurements:
        field = f"part_measurements.{part_id}"
        if part_id not in entries.parts:
            near = nearest(part_id, tuple(entries.parts))
            yield error(
                field,
                "values were measured on a part that is not in the catalogue",
                value=part_id,
                limit="a part of the catalogue",
                way_out=f"did you mean {', '.join(near)}?" if near else "correct its name",
            )
            continue
        try:
            part_of(design, part_id, entries.parts[part_id].kind)
        except DesignError as err:
            where, _, rest = str(err).partition(": ")
            what, _, way_out = rest.partition("; ")
            yield error(
                where,
                what,
                value=", ".join(f"{k} = {v:g}" for k, v in design.part_measurements[part_id].items()),
                limit="a value that the catalogue allows for the part",
                way_out=way_out or "correct or remove it",
            )


def _not_found(field: str, name: str, err: DesignError) -> Finding:
    what, _, way_out = str(err).partition("; ")
    return error(field, what, value=repr(name), limit="an entry of the catalogue", way_out=way_out)
