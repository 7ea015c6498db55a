"""Prices of the bill of materials: the user's own price list, the sum with what is missing, and a budget.

A price list is CSV with the columns of `bom.csv`. It needs `unit_cost`, `currency` and `cost_date`, and one of
`part_number`, `catalogue_id` and `item` to name the item; the other columns are optional. A filled copy of `bom.csv` is
one. Rows without `unit_cost` are ignored. A price is of one order unit. Prices of the list take precedence over those
of `design/data/orders.toml`.

A price is found by the part number, then by the catalogue's identifier, then by the item's name. So it is kept when a
buyer adds or replaces a part number, and the bill takes his. Names repeat ("supply capacitor"): a row with a part
number or an identifier is found by its name only together with its `value`, and only if no other row of the list has
both.

Currencies are not converted: each has its own sum, and a budget is compared with the sum in its own currency. Rows
without a price, or with one in another currency, are counted as unknown.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pydantic import ValidationError

from optopad.design.csv_table import CsvTable, read_csv
from optopad.design.errors import InputError, shown
from optopad.design.fields.quantity import Cost
from optopad.fabrication.sheets.bom import NO_PRICE, BomRow

CURRENCIES = (
    *("AUD", "BRL", "CAD", "CHF", "CNY", "CZK", "DKK", "EUR", "GBP", "HKD", "HUF", "ILS", "INR", "JPY"),
    *("KRW", "MXN", "NOK", "NZD", "PLN", "RON", "SEK", "SGD", "THB", "TRY", "TWD", "USD", "ZAR"),
)
"""Currencies of budgets and prices (ISO 4217)."""
KEYS = ("part_number", "catalogue_id", "item")
"""Columns that name the item, in the order in which they are tried."""
PriceKey = tuple[str, ...]
"""A column of `KEYS` with its text. The item's name may have the `value` as third."""
NEEDED = ("unit_cost", "currency", "cost_date")
MOST_PRICE = 1e9
_AMOUNT = r"[+-]?\d+(?:\.\d+|,\d{1,2})?"
"""A decimal comma has one or two digits after it, because three may be thousands."""
_BUDGET = re.compile(rf"\s*(?P<amount>{_AMOUNT})\s*(?P<currency>[A-Za-z]*)\s*")


@dataclass(frozen=True, kw_only=True)
class Price:
    """One row of a price list.

    Attributes
    ----------
    name : first filled column of `KEYS`
    cost : price of one order unit
    part_number, manufacturer : of what the buyer orders; empty if the list does not say
    """

    name: str
    cost: Cost
    part_number: str
    manufacturer: str


@dataclass(frozen=True, kw_only=True)
class Budget:
    """An amount of money that a sensor may cost."""

    amount: float
    currency: str


@dataclass(frozen=True, kw_only=True)
class HeldBudget:
    """A budget compared with the prices in its currency.

    Attributes
    ----------
    verdict : "undecided" as long as the known prices are within the budget and a row has no price in its currency
    known, left : sum of the known prices, and what they leave of the amount; negative if they exceed it
    """

    verdict: Literal["within", "over", "undecided"]
    amount: float
    currency: str
    known: float
    left: float
    rows_without_price: int

    @property
    def words(self) -> str:
        """The comparison as text, such as "over 25.00 EUR: 30.00 known, 5.00 too much"."""
        limit = f"{self.amount:.2f} {self.currency}"
        text = {
            "over": f"over {limit}: {self.known:.2f} known, {-self.left:.2f} too much",
            "undecided": f"not decided for {limit}: {self.known:.2f} known, {self.left:.2f} left for the rest",
            "within": f"within {limit}: {self.known:.2f} in all, {self.left:.2f} left",
        }[self.verdict]
        if self.rows_without_price:
            text += f"; {self.rows_without_price} rows have no price in {self.currency}"
        return text


@dataclass(frozen=True, kw_only=True)
class BillSum:
    """Sum of a bill of materials.

    Attributes
    ----------
    known : sum of the known prices by currency
    rows : number of rows that are bought
    unpriced : number of these rows without a price
    unnumbered : names of the bought items without a part number
    """

    known: dict[str, float]
    rows: int
    unpriced: int
    unnumbered: tuple[str, ...]

    @property
    def words(self) -> str:
        """The sum as text, such as "23.40 EUR, 3 of 14 rows without a price"."""
        sums = " + ".join(f"{value:.2f} {currency}" for currency, value in sorted(self.known.items()))
        missing = (
            f"{self.unpriced} of {self.rows} rows without a price" if self.unpriced else "every row priced"
        )
        return f"{sums or 'no price known'}, {missing}"


def bill_sum(rows: Sequence[BomRow]) -> BillSum:
    """Sum of the bought rows of a bill: order quantity times price of an order unit."""
    bought = [row for row in rows if row.is_bought]
    known: dict[str, float] = {}
    for row in bought:
        if row.cost is not None and row.price is not None:
            known[row.cost.currency] = known.get(row.cost.currency, 0.0) + row.price
    return BillSum(
        known=known,
        rows=len(bought),
        unpriced=sum(row.price is None for row in bought),
        unnumbered=tuple(row.item for row in bought if not row.part_number),
    )


def parsed_budget(text: str) -> Budget:
    """Parse a budget from the command line, as ``25EUR``.

    Raises
    ------
    InputError : the text is not an amount above 0 with the code of a known currency.
    """
    found = _BUDGET.fullmatch(text)
    if found is None:
        raise InputError(
            f"--budget: {shown(text)} is refused: write amount and currency, as 25EUR or 25.50EUR"
        )
    amount, currency = float(found["amount"].replace(",", ".")), found["currency"].upper()
    if not 0 < amount < MOST_PRICE:
        raise InputError(f"--budget: {shown(text)} is refused: the amount must be above 0, as 25EUR")
    _require_currency(currency, f"--budget: {shown(text)}")
    return Budget(amount=amount, currency=currency)


def held_against(rows: Sequence[BomRow], budget: Budget) -> HeldBudget:
    """Compare the prices in the budget's currency with it, and count the rows that have none."""
    known = bill_sum(rows).known.get(budget.currency, 0.0)
    unknown = sum(
        row.cost is None or row.price is None or row.cost.currency != budget.currency
        for row in rows
        if row.is_bought
    )
    return HeldBudget(
        verdict="over" if known > budget.amount else "undecided" if unknown else "within",
        amount=budget.amount,
        currency=budget.currency,
        known=round(known, 2),
        left=round(budget.amount - known, 2),
        rows_without_price=unknown,
    )


def read_prices(file: Path) -> dict[PriceKey, Price]:
    """Read a price list, by every name that an item of the bill may be found by.

    Raises
    ------
    InputError : a column is missing, a row names no item or has no valid price, or two rows differ for one item.
    """
    table = read_csv(file, needed=f"the columns {', '.join(NEEDED)} and one of {', '.join(KEYS)}")
    missing = [name for name in NEEDED if name not in table.heading]
    if missing or not set(KEYS) & set(table.heading):
        lacks = missing or [" or ".join(KEYS)]
        raise InputError(f"{file}: has no column {', '.join(lacks)}; a filled copy of bom.csv has all")
    records = table.records()
    items = Counter((record.get("item", ""), record.get("value", "")) for record in records)
    found: dict[PriceKey, Price] = {}
    for place, record in enumerate(records):
        if not record["unit_cost"]:
            continue
        price = _price(table, place, record)
        for key in _keys(record, items):
            held = found.setdefault(key, price)
            if (held.cost, held.part_number) != (price.cost, price.part_number):
                raise InputError(
                    f"{table.where(place)}: {shown(key[1])} has another price or part number in a row above; keep one"
                )
    return found


def _keys(record: Mapping[str, str], items: Mapping[tuple[str, str], int]) -> Iterator[PriceKey]:
    """The keys of a row, with the number of rows by name and value."""
    named = [(key, record[key]) for key in ("part_number", "catalogue_id") if record.get(key)]
    yield from named
    item, value = record.get("item", ""), record.get("value", "")
    if item and not named:
        yield "item", item
    elif item and items[item, value] == 1:
        yield "item", item, value


def priced(rows: Sequence[BomRow], prices: Mapping[PriceKey, Price]) -> tuple[BomRow, ...]:
    """The rows of a bill with the prices of a price list."""
    return tuple(_with_price(row, prices) for row in rows)


def unused_words(rows: Sequence[BomRow], prices: Mapping[PriceKey, Price]) -> str | None:
    """The prices of a list that no bought row of a bill takes, as text; None if each is taken."""
    names = list(dict.fromkeys(price.name for price in prices.values()))
    taken = {price.name for row in rows if (price := _price_of(row, prices)) is not None}
    unused = [name for name in names if name not in taken]
    return f"{len(unused)} of {len(names)} prices match no row: {', '.join(unused)}" if unused else None


def _price_of(row: BomRow, prices: Mapping[PriceKey, Price]) -> Price | None:
    keys: tuple[PriceKey, ...] = (
        ("part_number", row.part_number),
        ("catalogue_id", row.catalogue_id),
        ("item", row.item, row.value),
        ("item", row.item),
    )
    return next((prices[key] for key in keys if key in prices), None) if row.is_bought else None


def _with_price(row: BomRow, prices: Mapping[PriceKey, Price]) -> BomRow:
    price = _price_of(row, prices)
    if price is None:
        return row
    if price.part_number in ("", row.part_number):
        return replace(row, cost=price.cost)
    return replace(
        row,
        cost=price.cost,
        part_number=price.part_number,
        manufacturer=price.manufacturer,
        is_number_read=True,
    )


def _price(table: CsvTable, place: int, record: Mapping[str, str]) -> Price:
    where = table.where(place)
    text, currency = record["unit_cost"].strip(), record["currency"].strip().upper()
    try:
        value = float(text.replace(",", ".") if re.fullmatch(_AMOUNT, text) else text)
    except ValueError:
        value = math.nan
    if not 0 <= value < MOST_PRICE:
        raise InputError(
            f"{where}: unit_cost {shown(record['unit_cost'])} is no price; write a number, as 8.90"
        )
    _require_currency(currency, f"{where}: currency")
    source = record.get("cost_source", "")
    try:
        cost = Cost(
            value=value,
            currency=currency,
            date=record["cost_date"],
            source=table.file.name if source in ("", NO_PRICE) else source,
        )
    except ValidationError:
        raise InputError(
            f"{where}: cost_date {shown(record['cost_date'])} is no date; write yyyy-mm or yyyy-mm-dd"
        ) from None
    name = next((record[key] for key in KEYS if record.get(key)), None)
    if name is None:
        raise InputError(f"{where}: names no item; fill one of {', '.join(KEYS)}")
    return Price(
        name=name,
        cost=cost,
        part_number=record.get("part_number", ""),
        manufacturer=record.get("manufacturer", ""),
    )


def _require_currency(currency: str, where: str) -> None:
    if currency not in CURRENCIES:
        what = f"{shown(currency)} is not a known currency" if currency else "has no currency"
        raise InputError(f"{where} {what}; known are {', '.join(CURRENCIES)}")
