"""Comparison of designs: their differences, their scores, and the better design by each figure.

Each design is scored with two seeds of the light model. The figure from the first seed is reported. Its uncertainty is
its own numerical error, or for figures of the verdict the difference from the second seed's figure if that is larger.
Depths have at least the error of the depth step (0.04 mm at a boundary between modes, `optopad.sims.press`). A winner
is marked only if it is better than every other design by more than the sum of both uncertainties. Effects outside the
models are assumed equal for all designs, and are not part of the uncertainty. Figures of single pairs have no winner,
because a pad is judged by all pairs together.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from optopad.cli.verb import SHARED, typed, verb
from optopad.design.errors import InputError
from optopad.design.fields.base import leaves
from optopad.design.io import write_text_atomically
from optopad.design.progress import OnStep, silent
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.report.before_after import compare_html
from optopad.screen.answer import Result
from optopad.screen.comparison import MOST_DESIGNS, NAMES, ComparedRecording, Comparison, Measure, labelled
from optopad.screen.figures import Better, FigureCell, PadFigures, figures_of
from optopad.sims.learning.recorded_press import recorded_press
from optopad.sims.plots.files import write_plot
from optopad.sims.plots.signal import plot_recorded
from optopad.sims.plots.style import plain_style, svg_text
from optopad.sims.plots.sweep import plot_sweep
from optopad.sims.readings.recording import read_recording
from optopad.sims.score.sweep import sweep_row
from optopad.work import OUT, as_netcdf, is_recording, parsed_change, read_design

if TYPE_CHECKING:
    from optopad.sims.score.result import ContinuityScore

PRESSES = (".nc", ".csv")
"""Suffixes of recorded presses; other recordings are known by their names."""
ABSENT = "(absent)"
OF_ONE_KIND = ("margin", "depth")
"""Figures that mean something else for facing rows than for other pads."""


@verb(
    what=typed("DESIGN..."),
    with_=typed("PATH=VALUE"),
    at=typed("X,Y"),
    set_=SHARED["set_"],
)
def compare_command(
    what: Sequence[str],
    *,
    with_: Sequence[str] = (),
    pair: Sequence[str] = (),
    at: str | None = None,
    topic: str | None = None,
    press_topic: str | None = None,
    set_: Sequence[str] = (),
    fine: bool = False,
    out: Path = Path(OUT),
    seed: int = 0,
    on_step: OnStep,
) -> Result:
    """Compare designs and their scores, or a measured press with the simulated curve.

    Parameters
    ----------
    what : Designs, bundles or presets; or one and a RECORDING (.nc, .csv, .optorec, .mcap, bag).
    with_ : A copy of the first design with this change, as receivers.part=...; several changes: 'A=1;B=2'. Repeatable:
        one copy each.
    pair : Recording: a pair to show, as E1-R1. Repeatable.
    at : Recording: the location whose press is shown [mm].
    """
    recordings = [name for name in what if Path(name).suffix.lower() in PRESSES or is_recording(Path(name))]
    if not recordings:
        if pair or at or topic or press_topic:
            raise InputError(
                "compare: --pair, --at, --topic and --press-topic are for a recording; leave them out, or name its file"
            )
        designs, labels = _read(what, with_, set_)
        return _compared(designs, labels, out, fine=fine, seed=seed, on_step=on_step)
    if len(what) != 2 or len(recordings) != 1:
        raise InputError("compare: a recording is compared with one design: DESIGN RECORDING")
    if with_:
        raise InputError(
            "compare: --with makes copies of a design; a recording is compared with the design that was built"
        )
    design = read_design(next(name for name in what if name not in recordings), set_)
    file = Path(recordings[0])
    require_valid(design)
    with as_netcdf(file, topic, press_topic) as netcdf:
        recording = read_recording(netcdf, design)
    on_step("light", 0.0)
    press = recorded_press(design, recording, pairs=tuple(pair), at_mm=_parsed_place(at), seed=seed)
    on_step("light", 1.0)
    found = ComparedRecording(
        press=press,
        digest=design.digest,
        recording=str(file),
        folder=out / bundle_name(design) / "sims",
        stem=f"recorded-{_content_digest(file, topic, press_topic)[:8]}",
    )
    _write(design, out, found, lambda: plot_recorded(press), seed)
    return found


def _read(
    what: Sequence[str], with_: Sequence[str], set_: Sequence[str]
) -> tuple[list[SensorDesign], list[str]]:
    designs = [read_design(name, set_) for name in what]
    names = [design.name for design in designs]
    labels = names if len(set(names)) == len(names) else list(what)
    for text in with_:
        changes = dict(parsed_change(one, option="--with") for one in text.split(";"))
        designs.append(designs[0].with_(**changes))
        labels.append(text)
    return designs, labels


def compare(
    designs: Mapping[str, SensorDesign] | Sequence[SensorDesign],
    *,
    fine: bool = False,
    seed: int = 0,
    out: str | PathLike[str] = OUT,
    on_step: OnStep | None = None,
) -> Comparison:
    """Compare designs: the fields in which they differ, and the best design by each figure.

    Page and picture are written into the first design's bundle.

    Parameters
    ----------
    designs : two or more designs, as a mapping from names to designs, or as a sequence that uses the designs' own
        names; equal names are numbered

    Raises
    ------
    DesignError, InputError : too few designs are given, a design is given twice, or a design breaks a rule.
    """
    named = labelled(designs)
    step = on_step or silent
    return _compared(list(named.values()), list(named), Path(out), fine=fine, seed=seed, on_step=step)


def _compared(
    designs: Sequence[SensorDesign],
    labels: Sequence[str],
    out: Path,
    *,
    fine: bool,
    seed: int,
    on_step: OnStep,
) -> Comparison:
    _require_comparable(designs, labels)
    rows, figures, again = [], [], []
    for done, (design, label) in enumerate(zip(designs, labels, strict=True)):
        on_step("comparison", done / len(designs))
        row = sweep_row(design, label, _judged(design, fine=fine, seed=seed, verdict_only=False))
        rows.append(row)
        figures.append(figures_of(design, row.score))
        again.append(figures_of(design, _judged(design, fine=fine, seed=seed + 1, verdict_only=True)))
    on_step("comparison", 1.0)
    found = Comparison(
        labels=tuple(labels),
        digests=tuple(design.digest for design in designs),
        rows=tuple(rows),
        figures=tuple(figures),
        changes=changes_of(designs),
        measures=measures_of(figures, again),
        folder=out / bundle_name(designs[0]) / "sims",
        stem=f"compare-{hashlib.sha256(' '.join(d.digest for d in designs).encode()).hexdigest()[:8]}",
    )
    _write(designs[0], out, found, lambda: plot_sweep("designs", found.rows), seed)
    return found


def changes_of(designs: Sequence[SensorDesign]) -> dict[str, tuple[object, ...]]:
    """Fields in which the designs differ, as a mapping from dotted path to the value in each design.

    Name and description come last.
    """
    documents = [dict(leaves(design.model_dump(mode="json"))) for design in designs]
    known = dict.fromkeys(path for document in documents for path in document)
    ordered = sorted(known, key=lambda path: path in NAMES)
    changes = {  # an empty field equals a missing one
        path: tuple(ABSENT if one.get(path) is None else one[path] for one in documents) for path in ordered
    }
    return {path: values for path, values in changes.items() if any(one != values[0] for one in values)}


def measures_of(figures: Sequence[PadFigures], again: Sequence[PadFigures]) -> tuple[Measure, ...]:
    """Figures of all designs and their uncertainties, from scores with one seed (`figures`) and another (`again`)."""
    mixed = len({one.is_facing_rows for one in figures}) > 1
    found = []
    for cells, others in zip(
        *(zip(*(one.cells for one in made), strict=True) for made in (figures, again)), strict=True
    ):
        first = cells[0]
        if not first.better:
            continue
        values = tuple(cell.value for cell in cells)
        spread = tuple(map(_uncertainty, cells, others))
        is_alike = not (mixed and first.name in OF_ONE_KIND)
        found.append(
            Measure(
                name=first.name,
                unit=first.unit,
                better=first.better,
                values=values,
                texts=tuple(cell.text for cell in cells),
                uncertainty=spread,
                winner=_winner(first.better, values, spread) if is_alike else None,
            )
        )
    return tuple(found)


def _uncertainty(cell: FigureCell, other: FigureCell) -> float:
    """The figure's own error, or its difference from that of another seed if that is larger."""
    if cell.value is None or other.value is None or math.isinf(cell.value) or math.isinf(other.value):
        return cell.error
    return max(cell.error, abs(cell.value - other.value))


def _winner(better: Better, values: tuple[float | None, ...], spread: tuple[float, ...]) -> int | None:
    if not better or any(value is None for value in values):
        return None
    sign = 1.0 if better == "higher" else -1.0
    ranked = sorted(range(len(values)), key=lambda number: -sign * (values[number] or 0.0))
    best = ranked[0]
    for other in ranked[1:]:
        lead = sign * ((values[best] or 0.0) - (values[other] or 0.0))
        if not lead > spread[best] + spread[other]:  # also if both are infinite
            return None
    return best


def _judged(design: SensorDesign, *, fine: bool, seed: int, verdict_only: bool) -> ContinuityScore:
    from optopad.sims.score.scoring import score

    return score(design, fine=fine, seed=seed, verdict_only=verdict_only, tolerance=False)


def _require_comparable(designs: Sequence[SensorDesign], labels: Sequence[str]) -> None:
    if len(designs) < 2:
        raise InputError(
            "compare: one design alone; name a second, or change a copy of it with --with PATH=VALUE"
        )
    if len(designs) > MOST_DESIGNS:
        raise InputError(f"compare: {len(designs)} designs are refused: give 2 to {MOST_DESIGNS}")
    for number, design in enumerate(designs):
        require_valid(design)
        same = next((k for k in range(number) if designs[k].digest == design.digest), None)
        if same is not None:
            raise InputError(
                f"compare: {labels[same]} and {labels[number]} are the same design; change one of them"
            )


def _write(
    design: SensorDesign,
    out: Path,
    found: Comparison | ComparedRecording,
    plot: Callable[[], Figure],
    seed: int,
) -> None:
    """Write the data, the picture, and the page of compared designs."""
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        stem = folder / "sims" / found.stem
        text = json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(stem.with_name(f"{stem.name}.json"), text)
        with plain_style():
            figure = plot()
            write_plot(figure, stem)
            page = compare_html(found, svg_text(figure, stem.name)) if isinstance(found, Comparison) else ""
        if page:
            write_text_atomically(stem.with_name(f"{stem.name}.html"), page)


def _content_digest(file: Path, *topics: str | None) -> str:
    """SHA-256 of a recording's content, or of the files in its folder, and of the chosen topics."""
    digest = hashlib.sha256()
    for one in sorted(file.iterdir()) if file.is_dir() else [file]:
        if one.is_file():
            with one.open("rb") as stream:
                while piece := stream.read(1 << 20):
                    digest.update(piece)
    for topic in topics:
        digest.update((topic or "").encode())
    return digest.hexdigest()


def _parsed_place(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        x_mm, y_mm = (float(number) for number in text.split(","))
    except ValueError:
        raise InputError(f"--at: {text!r} is refused: write X,Y in millimetres, as 10,10") from None
    return x_mm, y_mm
