"""Writes the driver's configuration of a design, its wiring table and its bill of materials."""

from __future__ import annotations

import json
import shlex
from dataclasses import asdict
from pathlib import Path

from optopad.bundle_parts import checks_of, mold_mm3, write_fabrication
from optopad.cli.verb import Asked, typed, verb
from optopad.design.errors import InputError
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.fabrication.gain import SimulatedGain, gain_of
from optopad.fabrication.sheets.bom import SET_BY_GAIN
from optopad.fabrication.sheets.prices import bill_sum, held_against, parsed_budget, read_prices, unused_words
from optopad.screen.output import Told
from optopad.work import OUT


@verb(prices=typed("FILE"), budget=typed("AMOUNT"))
def config(
    design: SensorDesign,
    *,
    prices: Path | None = None,
    budget: str | None = None,
    out: Path = Path(OUT),
    seed: int = 0,
    asked: Asked,
) -> Told:
    """Write driver.toml, wiring table and bill of materials of a design.

    Parameters
    ----------
    prices : Your own prices, as a copy of bom.csv with unit_cost filled.
    budget : Compare the bill with an amount, as 25EUR.
    """
    limit = None if budget is None else parsed_budget(budget)
    own = None if prices is None else read_prices(prices)
    require_valid(design)
    with bundle(design, out, seed=seed) as staging:
        rows = write_fabrication(design, staging, _known_gain(staging), _mold_mm3(design, staging), own)
    folder, total = out / bundle_name(design) / "fabrication", bill_sum(rows)
    held = None if limit is None else held_against(rows, limit)
    unused = None if own is None else unused_words(rows, own)
    bill = {
        "known": total.known,
        "rows": total.rows,
        "rows_without_price": total.unpriced,
        "rows_set_by_gain": sum(SET_BY_GAIN in row.value for row in rows),
        "budget": None if held is None else asdict(held),
        "unused_prices": unused,
    }
    files = sorted(str(file) for file in folder.iterdir() if file.is_file())
    lines = [f"bill      {total.words}"]
    if unused is not None:
        lines.append(f"prices    {unused}")
    if held is not None:
        lines.append(f"budget    {held.words}")
    if bill["rows_set_by_gain"]:
        words = asked.words
        words += "" if out == Path(OUT) else f" --out {shlex.quote(str(out))}"
        lines.append(
            f"open      amplifier and feedback follow from the gain: optopad run {words}, then this command again"
        )
    return Told({"files": files, "bill": bill}, [*lines, f"files     {folder}"])


def _known_gain(folder: Path) -> SimulatedGain | None:
    score = folder / "sims" / "score.json"
    if not score.is_file():
        return None
    try:
        return gain_of(json.loads(score.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{score}: damaged, or of an earlier version; run `optopad score` again") from None


def _mold_mm3(design: SensorDesign, folder: Path) -> float:
    """Volume of the mold in a bundle, or of a new solid if none was made or its checks are damaged [mm3]."""
    try:
        return mold_mm3(checks_of(folder / "cad"))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        from optopad.cad.mold import build_mold

        return float(build_mold(design).val().Volume())  # type: ignore[union-attr]
