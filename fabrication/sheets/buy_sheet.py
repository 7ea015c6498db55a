"""Section of the build sheet on what to buy: part numbers, order units, prices, and their sum with what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from optopad.fabrication.sheets.bom import BomRow
from optopad.fabrication.sheets.prices import bill_sum
from optopad.fabrication.sheets.table import number, plain


def buy_lines(rows: Sequence[BomRow]) -> Iterator[str]:
    """Lines of the section on the shopping list in the build sheet, as Markdown."""
    yield "## Buy"
    yield ""
    yield "References and notes: `bom.csv`. A price is of one order unit; prices do not include shipping and tax."
    yield "Compare a part number with a star with the maker's page before you order: it was not read in a source."
    yield ""
    yield "| item | value | part number | needed | to order | unit price | price |"
    yield "|---|---|---|---|---|---|---|"
    bought = [row for row in rows if row.is_bought]
    yield from (_line(row) for row in bought)
    yield ""
    total = bill_sum(rows)
    yield f"Sum: {total.words}."
    if total.unnumbered:
        yield f"Without a part number: {plain(', '.join(dict.fromkeys(total.unnumbered)))}."
    for row in bought:
        if row.cost is not None:
            yield f"{plain(row.item)}: {plain(row.cost.source)} ({row.cost.date})."
    yield "Fill `unit_cost`, `currency` and `cost_date` in a copy of `bom.csv` for your own prices:"
    yield "`optopad driver config DESIGN --prices COPY.csv`. Solder, circuit board and filament are not listed."
    yield ""


def _line(row: BomRow) -> str:
    needed = (
        ""
        if row.quantity is None
        else f"{number(row.quantity)}{'' if row.unit == 'piece' else f' {row.unit}'}"
    )
    unit = "" if row.order_unit == "piece" else f" {row.order_unit}"
    order = "" if row.order_quantity is None else f"{row.order_quantity}{unit}"
    unit_price = price = ""
    if row.cost is not None and row.order_quantity is not None:
        unit_price = f"{row.cost.value:.2f} {row.cost.currency}"
        price = f"{row.order_quantity * row.cost.value:.2f} {row.cost.currency}"
    before, after = (row.item, row.value, row.part_number), (needed, order, unit_price, price)
    star = "" if row.is_number_read or not row.part_number else "*"
    return f"| {' | '.join(plain(cell) for cell in before)}{star} | {' | '.join(plain(cell) for cell in after)} |"
