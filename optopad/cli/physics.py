"""Commands for the physics: simulate, score, sweep, compare, rays, contact show."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optopad.cli import options
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.screen.output import foretell_score, progress, tell
from optopad.work import read_design

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
    from optopad.screen.answer import Answer, as_typed, labelled, learner_words

    read = read_design(design, set_)
    foretell_score(read, fine=fine, full=full, quiet=as_json)
    with progress(quiet=as_json) as step:
        result, folder = write_score(read, out, fine=fine, full=full, seed=seed, on_step=step, builds=drawn)
    answer, files = Answer.read(folder / "sims" / "answer.json"), labelled("files", str(folder))
    tell(
        as_json,
        result.to_json,
        lambda: (
            [*answer.details, labelled("size", answer.size), files]
            if details
            else answer.lines(
                [files], command=as_typed(design, set_), learner=learner_words(folder, read.digest)
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
