"""Rules for names in a design: parts, materials, boards and measured values must exist in the catalogue.

A missing name is reported once for each field that refers to it. The other rules still check everything else, so a
spelling mistake does not hide other errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from optopad.design.draft import Draft
from optopad.design.errors import DesignError
from optopad.design.fields.base import nearest
from optopad.design.fields.finding import Finding, error
from optopad.design.parts import catalog
from optopad.design.parts.catalog import CatalogEntries
from optopad.design.parts.circuits import EMITTER_CHIPS, RECEIVER_CHIPS, BoardChip, named_chip
from optopad.design.shape.cavity import part_field
from optopad.design.spec import SensorDesign
from optopad.design.spec.layout import Kind
from optopad.design.spec.properties import part_of

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
