"""The command `driver config`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from optopad.cli import options
from optopad.screen.output import print_json, say
from optopad.work import read_design


def config(
    design: options.Design,
    set_: options.Set = None,
    prices: Annotated[
        Path | None,
        typer.Option(
            "--prices", metavar="FILE", help="Your own prices, as a copy of bom.csv with unit_cost filled."
        ),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option("--budget", metavar="AMOUNT", help="Compare the bill with an amount, as 25EUR."),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Write driver.toml, wiring table and bill of materials of a design."""
    from dataclasses import asdict

    from optopad.fabrication.sheets.bom import SET_BY_GAIN
    from optopad.fabrication.sheets.prices import (
        bill_sum,
        held_against,
        parsed_budget,
        read_prices,
        unused_words,
    )
    from optopad.jobs.pipeline import write_driver_config
    from optopad.screen.verdict import as_typed

    limit, own = (
        None if budget is None else parsed_budget(budget),
        None if prices is None else read_prices(prices),
    )
    bundle, rows = write_driver_config(read_design(design, set_), out, seed=seed, prices=own)
    folder, total = bundle / "fabrication", bill_sum(rows)
    held = None if limit is None else held_against(rows, limit)
    unused = None if own is None else unused_words(rows, own)
    if as_json:
        bill = {
            "known": total.known,
            "rows": total.rows,
            "rows_without_price": total.unpriced,
            "rows_set_by_gain": sum(SET_BY_GAIN in row.value for row in rows),
            "budget": None if held is None else asdict(held),
            "unused_prices": unused,
        }
        files = sorted(str(file) for file in folder.iterdir() if file.is_file())
        print_json({"files": files, "bill": bill})
        return
    say(f"bill      {total.words}")
    if unused is not None:
        say(f"prices    {unused}")
    if held is not None:
        say(f"budget    {held.words}")
    if any(SET_BY_GAIN in row.value for row in rows):
        typed = as_typed(design, set_) + (
            "" if out == options.DEFAULT_OUT else f" --out {shlex.quote(str(out))}"
        )
        say(
            f"open      amplifier and feedback follow from the gain: optopad run {typed}, then this command again"
        )
    say(f"files     {folder}")
