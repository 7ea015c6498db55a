"""The verb export: a recording as netCDF, with the positions of the stage that pressed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from design.errors import InputError
from optopad.cli import options
from optopad.cli.output import print_json, say

if TYPE_CHECKING:
    from fabrication.driver.recording.joined_log import JoinedLog


def export(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="A file of `driver record`.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="netCDF (.nc) or a table (.csv); by default .nc, next to the recording.",
            callback=options.file_name(".nc", ".csv"),
        ),
    ] = None,
    presses: Annotated[
        Path | None,
        typer.Option(
            "--presses",
            metavar="CSV",
            help="Where it was pressed: t_s (the board's clock), x_mm, y_mm, depth_mm.",
        ),
    ] = None,
    stage: Annotated[
        Path | None,
        typer.Option(
            "--stage", metavar="CSV", help="A stage's log: time, x_mm, y_mm, depth_mm; perhaps set, place."
        ),
    ] = None,
    offset: Annotated[
        str | None,
        typer.Option("--offset", metavar="S", help="This machine's clock less the log's; `auto` finds it."),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """A recording as netCDF or CSV, as `optopad compare` and learners read it; a torn one gives what is whole."""
    from fabrication.driver.recording.export import read_recorded, write_csv, write_netcdf
    from fabrication.driver.recording.joined_log import joined
    from fabrication.driver.recording.position_log import read_position_log
    from fabrication.driver.simulated.finger import read_path

    target = out or recording.with_suffix(".nc")
    if target.resolve() == recording.resolve():
        raise InputError(f"--out {target}: is the recording itself; choose another name")
    options.checked_out(target, presses, stage)
    if presses is not None and stage is not None:
        raise InputError("--presses and --stage: two sources of positions; give one")
    if offset is not None and stage is None:
        raise InputError("--offset: shifts a stage's log; give --stage, too")
    shift = _parsed_offset(offset)
    log = None if stage is None else read_position_log(stage)
    found = read_recorded(recording, None if presses is None else read_path(presses))
    join = None if log is None else joined(found, log, shift)
    found = found if join is None else join.recorded
    write = write_csv if target.suffix.lower() == ".csv" else write_netcdf
    write(found, target, recording.name)
    document = {
        "file": str(target),
        "frames": len(found.sequence),
        "lost": found.lost,
        "doubled": found.doubled,
        "connections": int(found.connection[-1]),
        "ended_cleanly": found.ended_cleanly,
        "stray_bytes": found.stray_bytes,
        "has_presses": found.press_mm is not None,
    }
    if as_json:
        print_json(document if join is None else document | {"stage": _join_json(join)})
        return
    torn = (
        "" if found.ended_cleanly else f"; no clean end, {found.stray_bytes} bytes belong to no whole record"
    )
    say(
        f"{len(found.sequence)} frames, {found.lost} lost{f', {found.doubled} doubled' if found.doubled else ''}{torn}"
    )
    if join is not None:
        say(_join_line(join))
    if found.press_mm is None:
        say(
            "presses   none in it; `optopad compare` needs them (--presses, --stage, or the recorder's press())"
        )
    say(f"files     {target}")


def _parsed_offset(text: str | None) -> float | Literal["auto"] | None:
    if text is None:
        return None
    if text == "auto":
        return "auto"
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"--offset: {text!r} is refused: seconds, or auto")
    return value


def _join_json(join: JoinedLog) -> dict[str, Any]:
    match = join.match
    has_edges = math.isfinite(match.spread_s)
    return {
        "offset_s": round(join.offset_s, 4),
        "edges": match.edges,
        "edges_met": round(match.share, 4),
        "lag_s": round(match.offset_s - join.offset_s, 4) if has_edges else None,
        "spread_s": round(match.spread_s, 4) if has_edges else None,
        "left_out": join.left_out,
    }


def _join_line(join: JoinedLog) -> str:
    match, text = join.match, f"log       offset {join.offset_s:.3f} s"
    if math.isfinite(match.spread_s):
        lag = match.offset_s - join.offset_s
        text += f"; {match.share:.0%} of {match.edges} touch edges meet"
        text += f", {lag:+.3f} s late, scatter {match.spread_s:.3f} s"
    return text + f"; {join.left_out} frames without a known position left out"
