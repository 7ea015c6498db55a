"""Commands for the physics: simulate, score, sweep, compare, rays, contact show, contact build."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from optopad.cli import options
from optopad.design.errors import InputError
from optopad.design.spec import SensorDesign
from optopad.screen.output import print_json, progress, say, tell
from optopad.work import read_design

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign

DEFAULT_ORACLE_RAYS = 1_000_000


def simulate(
    design: options.Design,
    press: Annotated[
        list[str] | None,
        typer.Option(
            "--press", metavar="X,Y,DEPTH", help="A press [mm]; repeatable. Default: centre, all depths."
        ),
    ] = None,
    oracle: Annotated[
        bool, typer.Option("--oracle", help="Also trace with the plain ray tracer and compare.")
    ] = False,
    rays: Annotated[
        int | None,
        typer.Option(
            min=1000, help="Rays per emitter and state of --oracle's ray tracer (1000000 if left out)."
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
        _refuse_beside_protocol(press=press, oracle=oracle, rays=rays)
        _simulate_protocol(read, protocol, fit=fit, out=out, seed=seed, as_json=as_json)
        return
    if fit:
        raise InputError("--fit: needs --protocol, whose depths it fits; drop it")
    oracle_rays = _oracle_rays(oracle, rays)
    from optopad.jobs.pipeline import write_signals

    presses = [options.parsed_press(text) for text in press or []]
    with progress(quiet=as_json) as step:
        summary, folder = write_signals(read, presses, out, oracle_rays=oracle_rays, seed=seed, on_step=step)
    tell(as_json, lambda: summary, lambda: [*_signal_lines(summary), f"files     {folder}"])


def _oracle_rays(oracle: bool, rays: int | None) -> int | None:
    if not oracle:
        if rays is not None:
            raise InputError(f"--rays: {rays} needs --oracle, which traces them; add it, or drop --rays")
        return None
    return DEFAULT_ORACLE_RAYS if rays is None else rays


def _refuse_beside_protocol(**given: Any) -> None:
    for name, value in given.items():
        if value:
            raise InputError(f"--{name}: does not go with --protocol, which has presses of its own; drop one")


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
    if summary["oracle"] is not None:
        found = summary["oracle"]
        yield (
            f"ray tracer: {found['rays']} rays an emitter; chi-square {found['chi_square']:.1f} over "
            f"{found['compared']} pairs and states; largest difference {found['largest_z']:.1f} standard errors"
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


@contact.command()
def build(
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File of the library (.npz).",
            callback=options.file_name(".npz"),
        ),
    ] = Path("outputs/contact/profiles.npz"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Number of processes; default: one per processor.")
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Solve the library of presses again (two hours or more on two cores); an interrupted run continues."""
    import os

    from optopad.sims.contact.library.build import build_library, require_writable, write_library
    from optopad.sims.contact.library.profile_library import library_differences, shipped_library

    require_writable(out)

    def tell(done: int, total: int) -> None:
        if not as_json:
            typer.echo(f"solved    {done} of {total}", err=True)

    library = build_library(workers or os.cpu_count() or 1, tell)
    write_library(library, out)
    force, surface = library_differences(library, shipped_library())
    if as_json:
        print_json({"file": str(out), "force_difference": force, "surface_difference_tip_radii": surface})
        return
    say(f"file      {out}")
    say(
        f"difference from the shipped library: force within {100 * force:.2g} %, surface within "
        f"{surface:.2g} tip radii"
    )
