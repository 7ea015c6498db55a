"""The verb from a verdict to a better design: improve."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from design.errors import InputError
from design.spec import SensorDesign
from optopad.cli import options
from optopad.cli.output import print_json, say
from optopad.cli.progress import progress
from optopad.cli.verbs.explore import INTERRUPTED, telling
from optopad.work.designs import read_design


def improve(
    design: options.Design,
    set_: options.Set = None,
    vary: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="FIELD[=A:B]", help="Vary this field, too, from A to B. Repeatable."),
    ] = None,
    keep: Annotated[
        list[str] | None,
        typer.Option("--keep", metavar="FIELD", help="Leave this field as it is. Repeatable."),
    ] = None,
    more_parts: Annotated[
        bool, typer.Option("--more-parts", help="More parts a side may help, too.")
    ] = False,
    budget: Annotated[
        float | None,
        typer.Option(
            "--budget", metavar="MINUTES", help="Time to search, about: 3 for a pad, 2 for facing rows."
        ),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Up to four verified changes that mend or better a design, as design files; the same command goes on."""
    from optopad.jobs.improvement import improve as search_around

    read = read_design(design, set_)
    with progress(quiet=as_json) as step, telling(quiet=as_json) as tell:
        made = search_around(
            read,
            out,
            text=_text(design, read, is_changed=bool(set_)),
            vary=dict(_range(one) for one in vary or []),
            keep=keep or [],
            more_parts=more_parts,
            budget_min=budget,
            seed=seed,
            on_step=step,
            on_tried=tell,
        )
    if as_json:
        print_json(made.to_json())
    else:
        say("\n".join(made.lines()))
    if made.is_interrupted:
        raise typer.Exit(INTERRUPTED)


def _text(where: str, design: SensorDesign, *, is_changed: bool) -> str | None:
    """The design as its author wrote it; None where changes or parts of its own are not in that file."""
    from design.io import read_design_text
    from design.preset import preset_text

    path = Path(where)
    if is_changed or any(design.catalog.model_dump().values()):
        return None
    if not path.exists():
        return preset_text(where)
    text = read_design_text(path / "design.toml" if path.is_dir() else path)
    first, _, rest = text.partition("\n")
    return rest if first.startswith("# optopad design ") else text  # it names a digest, which will be another


def _range(text: str) -> tuple[str, tuple[float, float] | None]:
    """Path and range of one ``FIELD[=A:B]``."""
    path, equals, ends = text.partition("=")
    if not equals:
        return path.strip(), None
    try:
        low, high = (float(end) for end in ends.split(":"))
    except ValueError:
        raise InputError(
            f"--vary: {text!r} is refused: write FIELD=A:B, as receivers.height_mm=5:7"
        ) from None
    return path.strip(), (low, high)
