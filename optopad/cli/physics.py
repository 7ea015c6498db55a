"""Commands for the physics: simulate, score, sweep, compare, rays, contact show."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optopad.cli import options
from optopad.cli.output import foretell_score, progress, tell
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.work import is_recording, parsed_change, parsed_value, read_design

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign


def score(
    design: options.Design,
    set_: options.Set = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="A map of 11 locations per side with steps of 0.1 mm, with the usual light."
        ),
    ] = False,
    fine: options.Fine = False,
    tolerance: Annotated[
        bool,
        typer.Option(
            "--tolerance",
            help="Also run a Monte Carlo over all tolerances and report how many units keep the verdict.",
        ),
    ] = False,
    builds: Annotated[
        int | None,
        typer.Option("--builds", help="Units of the Monte Carlo of --tolerance (200 if left out)."),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    details: options.Details = False,
    as_json: options.Json = False,
) -> None:
    """Report the verdict: modes, deadbands, continuity, strength and a map of the pad, written into the bundle."""
    drawn = _drawn_builds(tolerance, builds)
    from optopad.jobs.pipeline import write_score
    from optopad.results.figures import summary_words
    from optopad.screen.verdict import as_typed, labelled, learner_line, score_lines, verdict_screen

    read = read_design(design, set_)
    foretell_score(read, fine=fine, full=full, quiet=as_json)
    with progress(quiet=as_json) as step:
        result, folder = write_score(read, out, fine=fine, full=full, seed=seed, on_step=step, builds=drawn)
    typed, files = as_typed(design, set_), labelled("files", str(folder))
    size = summary_words(read, result)
    tell(
        as_json,
        result.to_json,
        lambda: (
            [*score_lines(result), labelled("size", size), files]
            if details
            else verdict_screen(
                read,
                result,
                [files],
                command=typed,
                learner=learner_line(read, folder, typed),
                size=size,
            )
        ),
    )


def _drawn_builds(tolerance: bool, builds: int | None) -> int | None:
    if not tolerance:
        if builds is not None:
            raise InputError("--builds: needs --tolerance, whose units it counts; add it")
        return None
    from optopad.sims.score.build_tolerance import DEFAULT_BUILDS
    from optopad.sims.verdict.builds import FEWEST_BUILDS, MOST_BUILDS

    drawn = DEFAULT_BUILDS if builds is None else builds
    if not FEWEST_BUILDS <= drawn <= MOST_BUILDS:
        raise InputError(f"--builds: {drawn} is refused: give {FEWEST_BUILDS} to {MOST_BUILDS}")
    return drawn


def simulate(
    design: options.Design,
    press: Annotated[
        list[str] | None,
        typer.Option(
            "--press", metavar="X,Y,DEPTH", help="A press [mm]; repeatable. Default: centre, all depths."
        ),
    ] = None,
    protocol: Annotated[
        str | None,
        typer.Option(
            "--protocol",
            metavar="NAME|FILE",
            help="Press by a protocol and make its data set: piacenza2017, piacenza2017-quick, or a file.",
        ),
    ] = None,
    fit: Annotated[
        bool, typer.Option("--fit", help="With --protocol: leave out depths beyond the design's range.")
    ] = False,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Compute the light of chosen presses by path class, or the data set of a press protocol; netCDF in the bundle."""
    read = read_design(design, set_)
    if protocol is not None:
        if press:
            raise InputError("--press: does not go with --protocol, which has presses of its own; drop one")
        _simulate_protocol(read, protocol, fit=fit, out=out, seed=seed, as_json=as_json)
        return
    if fit:
        raise InputError("--fit: needs --protocol, whose depths it fits; drop it")
    from optopad.jobs.pipeline import write_signals

    presses = [options.parsed_press(text) for text in press or []]
    with progress(quiet=as_json) as step:
        summary, folder = write_signals(read, presses, out, seed=seed, on_step=step)
    tell(as_json, lambda: summary, lambda: [*_signal_lines(summary), f"files     {folder}"])


def _simulate_protocol(
    design: SensorDesign, where: str, *, fit: bool, out: Path, seed: int, as_json: bool
) -> None:
    from optopad.design.press_protocol import load_protocol_file
    from optopad.jobs.recorded import data_lines, write_protocol_data

    protocol = load_protocol_file(where)
    with progress(quiet=as_json) as step:
        summary = write_protocol_data(
            design, protocol.fitted_to(design) if fit else protocol, out, seed=seed, on_step=step
        )
    tell(as_json, lambda: summary, lambda: data_lines(summary))


def _signal_lines(summary: dict[str, Any]) -> Iterator[str]:
    for state in summary["states"]:
        x_mm, y_mm, depth_mm = state["press_mm"]
        shares = "  ".join(f"{name} {value:.3e}" for name, value in state["mean_flux_by_class"].items())
        yield (
            f"press {x_mm:6.2f} {y_mm:6.2f}  depth {depth_mm:5.2f} mm  mean flux {state['mean_flux']:.4e}  {shares}"
        )


MAX_SWEEP_VALUES = 200


def sweep(
    design: options.Design,
    field: Annotated[str, typer.Argument(metavar="FIELD=A:B:STEP", help="Field to vary; or FIELD=v1,v2,...")],
    set_: options.Set = None,
    fine: options.Fine = False,
    build: Annotated[
        bool,
        typer.Option(
            "--build", help="Make the whole bundle of each value; the value is engraved in its mold."
        ),
    ] = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Score a design at values of one field: table and figure; the same command continues an interrupted run."""
    path, values = parsed_sweep(field)
    read = read_design(design, set_)
    from optopad.jobs.sweep import run_sweep

    with progress(quiet=as_json) as step:
        made = run_sweep(read, path, values, out, fine=fine, seed=seed, build=build, on_step=step)
    bundles = [f"bundle    {folder}" for folder in made.bundles]
    files = f"files     {made.folder / 'sims'} (sweep-{path}: csv, json, svg, png)"
    tell(as_json, made.to_json, lambda: [*made.lines(), *bundles, files])


def parsed_sweep(text: str) -> tuple[str, list[Any]]:
    """Parse field and values from a text ``FIELD=A:B:STEP`` (both ends included) or ``FIELD=v1,v2,...``.

    Whole numbers become int, for fields that count parts.

    Raises
    ------
    InputError : the text has another form, or the range is empty or infinite.
    """
    from optopad.design.errors import InputError

    path, equals, span = text.partition("=")
    if not equals or not path or not span:
        raise InputError(
            f"sweep: {text!r} is refused: write FIELD=A:B:STEP, as cavity.clear_thickness_mm=6:12:0.5"
        )
    if ":" not in span:
        return path, _listed(span)
    try:
        first, last, step = (float(number) for number in span.split(":"))
    except ValueError:
        raise InputError(f"sweep: {span!r} is refused: write A:B:STEP, three numbers") from None
    steps = (last - first) / step + 1e-9 if step > 0 else math.nan
    if not 0 <= steps < MAX_SWEEP_VALUES:  # also false for a number that is not finite
        raise InputError(
            f"sweep: {span!r} is refused: give 1 to {MAX_SWEEP_VALUES} values, A up to B, STEP above 0"
        )
    values = [round(first + step * number, 9) for number in range(math.floor(steps) + 1)]
    is_whole = all(_is_whole(number) for number in span.split(":"))
    return path, [int(value) for value in values] if is_whole else list(values)


def _is_whole(text: str) -> bool:
    try:
        int(text)
    except ValueError:
        return False
    return True


def _listed(span: str) -> list[Any]:
    from optopad.design.errors import InputError

    texts = [text.strip() for text in span.split(",")]
    if not all(texts):
        raise InputError(f"sweep: {span!r} is refused: a value between commas is missing")
    if len(texts) > MAX_SWEEP_VALUES:
        raise InputError(f"sweep: {len(texts)} values are refused: give 1 to {MAX_SWEEP_VALUES}")
    return [parsed_value(text) for text in texts]


PRESSES = (".nc", ".csv")


def compare(
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="DESIGN...",
            help="Designs, bundles or presets; or one and a RECORDING (.nc, .csv, .optorec, .mcap, bag).",
        ),
    ],
    with_: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="PATH=VALUE",
            help="A copy of the first design with this change, as receivers.part=...; several changes: "
            "'A=1;B=2'. Repeatable: one copy each.",
        ),
    ] = None,
    pair: Annotated[
        list[str] | None, typer.Option("--pair", help="Recording: a pair to show, as E1-R1. Repeatable.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y", help="Recording: the location whose press is shown [mm]."),
    ] = None,
    topic: options.Topic = None,
    press_topic: options.PressTopic = None,
    set_: options.Set = None,
    fine: options.Fine = False,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Compare designs and their scores, or a measured press with the simulated curve."""
    recordings = [name for name in what if Path(name).suffix.lower() in PRESSES or is_recording(Path(name))]
    topics = (topic, press_topic)
    if recordings:
        _recording(what, recordings, with_, pair, at, topics, set_, out, seed, as_json)
        return
    _refuse(
        pair or at or any(topics),
        "--pair, --at, --topic and --press-topic are for a recording; leave them out, or name its file",
    )
    from optopad.jobs.compare import compare as hold

    designs, labels = _designs(what, with_, set_)
    with progress(quiet=as_json) as step:
        found = hold(designs, labels, out, fine=fine, seed=seed, on_step=step)
    files = f"files     {found.folder} ({found.stem}: html, json, svg, png)"
    tell(as_json, found.to_json, lambda: [*found.lines(), files])


def _designs(
    what: list[str], with_: list[str] | None, set_: list[str] | None
) -> tuple[list[SensorDesign], list[str]]:
    designs = [read_design(name, set_) for name in what]
    labels = _labels(what, [design.name for design in designs])
    for text in with_ or []:
        changes = dict(parsed_change(one, option="--with") for one in text.split(";"))
        designs.append(designs[0].with_(**changes))
        labels.append(text)
    return designs, labels


def _labels(what: list[str], names: list[str]) -> list[str]:
    return names if len(set(names)) == len(names) else list(what)


def _refuse(given: object, message: str) -> None:
    from optopad.design.errors import InputError

    if given:
        raise InputError(f"compare: {message}")


def _recording(
    what: list[str],
    recordings: list[str],
    with_: list[str] | None,
    pair: list[str] | None,
    at: str | None,
    topics: tuple[str | None, str | None],
    set_: list[str] | None,
    out: Path,
    seed: int,
    as_json: bool,
) -> None:
    _refuse(
        len(what) != 2 or len(recordings) != 1, "a recording is compared with one design: DESIGN RECORDING"
    )
    _refuse(with_, "--with makes copies of a design; a recording is compared with the design that was built")
    from optopad.jobs.recorded import compare_recording, recorded_lines

    place, file = next(name for name in what if name not in recordings), Path(recordings[0])
    read = read_design(place, set_)
    with progress(quiet=as_json) as step:
        found = compare_recording(
            read,
            file,
            out,
            pairs=pair or [],
            at=at,
            seed=seed,
            topic=topics[0],
            press_topic=topics[1],
            on_step=step,
        )
    files = f"files     {found.folder} ({found.stem}: json, svg, png)"
    tell(as_json, found.to_json, lambda: [*recorded_lines(found), files])


def rays(
    design: options.Design,
    emitter: Annotated[
        str | None,
        typer.Option(metavar="E1", help="One emitter, by its name in the wiring table. Default: all."),
    ] = None,
    receiver: Annotated[
        str | None,
        typer.Option(
            metavar="R1", help="One receiver, by its name. With --emitter: a pair, cut along its chord."
        ),
    ] = None,
    press: Annotated[
        list[str] | None,
        typer.Option(
            "--press",
            metavar="X,Y,DEPTH",
            help="A press [mm]; repeatable. Default: both ends of the deadband if a verdict found one, "
            "else three depths, at the pair's middle or the pad's location of least margin.",
        ),
    ] = None,
    count: Annotated[
        int, typer.Option(min=1, max=200, help="Number of paths of the strongest kind of light.")
    ] = 24,
    set_: options.Set = None,
    out: options.Out = options.DEFAULT_OUT,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Draw sample paths of light, untouched and pressed: mode 1, mode 2, scattered, lost; pictures in the bundle."""
    presses = tuple(options.parsed_press(text) for text in press or [])
    read = read_design(design, set_)

    from optopad.design.shape.cavity import cavity_of
    from optopad.jobs.ray_view import (
        RayRequest,
        part_number,
        view_json,
        view_lines,
        view_rays,
        write_pictures,
    )

    cavity = cavity_of(read)
    request = RayRequest(
        emitter=None if emitter is None else part_number(cavity.emitters, emitter, "--emitter"),
        receiver=None if receiver is None else part_number(cavity.receivers, receiver, "--receiver"),
        presses=presses,
        count=count,
    )
    with progress(quiet=as_json) as step:
        view = view_rays(read, request, out, seed=seed, on_step=step)
        files = write_pictures(view, out)
    names = [str(file) for file in files]
    where = [f"file      {file}" for file in files]
    tell(as_json, lambda: view_json(view) | {"files": names}, lambda: [*view_lines(view), *where])


contact = typer.Typer(name="contact", help="The contact model: press, surface, force.", no_args_is_help=True)


@contact.command()
def show(
    design: options.Design,
    depth: Annotated[float, typer.Option(help="Depth of the press [mm].")] = 2.0,
    protocol: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Also the load over a load protocol: piacenza2017."),
    ] = None,
    set_: options.Set = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Also write pictures, as SVG and PNG, into the bundle in this folder.",
            callback=options.require_folder,
        ),
    ] = None,
    seed: options.Seed = 0,
    as_json: options.Json = False,
) -> None:
    """Compute load, surface and pressure of a centred press; with a protocol, also the load in retraction."""
    from optopad.jobs.press_view import view_json, view_lines, view_press, write_pictures

    read = read_design(design, set_)
    with progress(quiet=as_json) as step:
        view = view_press(read, depth, protocol, on_step=lambda share: step("contact", share))
        files = [] if out is None else write_pictures(view, out, seed=seed)
    names = [str(file) for file in files]
    where = [f"files     {files[0].parent}/contact-*"] if files else []
    tell(as_json, lambda: view_json(view) | {"files": names}, lambda: [*view_lines(view), *where])
