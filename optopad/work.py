"""A program of ours as a process of its own, by this interpreter and with what this one can import.

Work on a thread of its own: light is traced outside Python, so pictures are drawn beside it.

A design by a word: a file, a bundle or a preset, with changes on top.

Designs judged on a Dask cluster: a search's batch goes out, answers come back in any order.

The cluster is the user's: scheduler and workers with the same optopad installed. A worker that dies loses nothing: the
scheduler gives its designs to another. The kernels use all processors of a worker by themselves, so workers want one
thread each (`dask worker --nthreads 1`).

Finished pieces of long work, kept beside the bundle so that an interrupted command goes on where it stopped.

One line of JSON a piece, appended and flushed as soon as it is known; a line that was cut short by a power
cut is ignored. A store answers only for the same work: its file is named by a hash of what was asked (the
caller's key: digests, seed, settings) and of all sources and data that a result depends on, so a changed
program never takes up an old result. The file is removed when the work is done.

A figure as files: SVG with text for pages and print, PNG for everything that cannot read SVG.

What others need to know of a prediction without its libraries: its file, and how long a quick one takes.

Almost all of the time is light; places that a symmetry of the layout carries onto each other are traced once. Measured
on `fingertip-16`, a ring of 4 + 4 parts on 30 x 22 mm, and the paper's pad, on two cores shared with other work: 122,
46 and 129 ms of processor time a press (64, 16 and 64 pairs). The constants below are a sixth lower, for a machine
without other work. What is left is the fit of the paper's learner at quick settings (0.3 to 5 s), its test, and the
pictures.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakSet

import numpy as np
from matplotlib.figure import Figure

import design
import sims
from design.errors import DesignError, InputError, ModelScopeError, OptopadError
from design.files import unwritable, write_whole
from design.io import write_text_atomically
from design.protocols.press import load_protocol_file
from design.search.improve import FanOut, Judged, Limit, Objective
from design.shape.cavity import cavity_of
from design.spec import SensorDesign
from design.toml_text import parsed_toml
from sims.bounds.observability import PadBounds
from sims.plots.maps import plot_bound_sheet, plot_felt_map
from sims.plots.style import plain_style, svg_text

if TYPE_CHECKING:
    from design.spec import SensorDesign

_STARTED: WeakSet[subprocess.Popen[str]] = WeakSet()


def started(
    arguments: Sequence[str],
    *,
    stdin: int = subprocess.DEVNULL,
    stdout: int = subprocess.DEVNULL,
    stderr: int = subprocess.PIPE,
) -> subprocess.Popen[str]:
    """Start ``python ARGUMENTS``.

    Parameters
    ----------
    arguments : as ``["-m", "cad", ...]``
    stdin, stdout, stderr : as `subprocess.Popen` takes them
    """
    # -P: a design.py or cad.py of the user's in the current folder must not stand in for ours
    process = subprocess.Popen(
        [sys.executable, "-P", *arguments],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        stdin=stdin,
        stdout=stdout,
        stderr=stderr,
        text=True,
        errors="replace",
    )
    _STARTED.add(process)
    return process


def end_started() -> None:
    """End every program that was started here and still runs."""
    for process in tuple(_STARTED):
        if process.poll() is None:
            process.kill()
            process.wait()


Made = TypeVar("Made")


@contextmanager
def beside(work: Callable[[], Made]) -> Iterator[Callable[[], Made]]:
    """Start work; what is yielded waits for it and gives what it made, or raises what it raised.

    The block is not left before the work is done, and an error of the work leaves it at the latest then.
    """
    with ThreadPoolExecutor(max_workers=1) as pool:
        started = pool.submit(work)
        yield started.result
        started.result()


def read_design(where: str, changes: list[str] | None) -> SensorDesign:
    """Load a design file, a bundle's design, or a preset, and apply ``--set`` changes.

    Raises
    ------
    DesignError, InputError : what is wrong with the file or a change.
    """
    from design.fields.base import nearest
    from design.io import load_design
    from design.preset import PRESETS, preset

    path = Path(where)
    if not path.exists() and where in PRESETS:
        design = preset(where)
    elif not path.exists() and not path.suffix:
        near = nearest(where, PRESETS)
        hint = f"did you mean {near[0]}?" if near else f"presets: {', '.join(PRESETS)}"
        raise InputError(f"{where}: no such file, bundle or preset; {hint}")
    else:
        design = load_design(path / "design.toml" if (path / "manifest.json").is_file() else path)
    return design.with_(**dict(parsed_change(change) for change in changes)) if changes else design


def parsed_change(text: str, *, option: str = "--set") -> tuple[str, Any]:
    """Path and value of one ``PATH=VALUE``; the value is read as TOML, else as plain text.

    Raises
    ------
    InputError : no ``=`` or no path.
    """
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"{option}: {text!r} is refused: write PATH=VALUE, as cavity.clear_thickness_mm=10")
    return path.strip(), parsed_value(value.strip())


def parsed_value(text: str) -> Any:
    """A value written as in a design file; bare words are text."""
    try:
        return parsed_toml(f"value = {text}")["value"]
    except ValueError:  # not TOML, a whole number of thousands of digits, nested too deep
        return text


CONNECT_TIMEOUT_S = 10


@contextmanager
def on_cluster(address: str) -> Iterator[FanOut]:
    """A fan-out over the workers of the scheduler at an address, as tcp://127.0.0.1:8786.

    Raises
    ------
    InputError : the package is missing, no scheduler answers, it has no workers, or it is lost on the way.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler: needs the package distributed; install it (pip install distributed), or leave it out"
        ) from None
    try:
        client: Any = Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TimeoutError) as err:
        reason = str(err).splitlines()[0] if str(err) else type(err).__name__
        raise InputError(
            f"--scheduler: no scheduler answers at {address!r}: {reason}; start one with `dask scheduler`"
        ) from None
    with client:
        if not client.scheduler_info()["workers"]:
            raise InputError(
                f"--scheduler: {address} has no workers; start some with `dask worker {address} --nthreads 1`"
            )
        yield _fan_out(client, address)


def _fan_out(client: Any, address: str) -> FanOut:
    from distributed import CancelledError, KilledWorker, as_completed

    def fan_out(
        objective: Objective, designs: Sequence[SensorDesign], limits: tuple[Limit, ...]
    ) -> Iterable[tuple[int, Judged]]:
        sent = {
            client.submit(objective, design, limits, pure=False): number
            for number, design in enumerate(designs)
        }
        try:
            for future in as_completed(list(sent), loop=client.loop):  # type: ignore[no-untyped-call]
                yield sent[future], future.result()
        except OptopadError:
            raise
        except KilledWorker as err:
            raise InputError(
                f"--scheduler: workers of {address} die over one design ({err.last_worker}); see their logs: memory is "
                "the usual cause (finished designs are kept)"
            ) from None
        except (CancelledError, OSError, TimeoutError) as err:
            raise InputError(
                f"--scheduler: {address} was lost: {err or type(err).__name__}; finished designs are kept: "
                "start it again and give the same command"
            ) from None

    return fan_out


SOURCES = ("*.py", "*.toml", "*.npz")
ROOMS = (design, sims)


class FinishedWork:
    """Results by name, in memory and in one file.

    Parameters
    ----------
    out : folder of the bundles; made when missing
    title : start of the file's name, as ``piacenza2017-pair-0123abcd.sweep``
    asked : plain data that says what is worked on
    """

    def __init__(self, out: Path, title: str, asked: object) -> None:
        text = json.dumps([asked, source_digest()], sort_keys=True)
        self.path = out / f".{title}.{hashlib.sha256(text.encode()).hexdigest()[:16]}.jsonl"
        self._results = _read(self.path)

    def __len__(self) -> int:
        return len(self._results)

    def get(self, name: str) -> Any | None:
        """An earlier result; None when there is none."""
        return self._results.get(name)

    def put(self, name: str, result: Any) -> None:
        """Keep a result on the disk.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        self._results[name] = result
        line = json.dumps({"name": name, "result": result}, allow_nan=False) + "\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write("\n" + line)  # the line before may have been cut short
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as err:
            raise unwritable(self.path, err, "choose another folder with --out") from err

    def forget(self) -> None:
        """Remove the file: the work is done and lies in its bundle."""
        self._results = {}
        self.path.unlink(missing_ok=True)


@cache
def source_digest() -> str:
    """SHA-256 over every source and data file of the rooms that results depend on, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for room in ROOMS:
        folder = Path(str(room.__file__)).parent
        for path in sorted(found for pattern in SOURCES for found in folder.rglob(pattern)):
            digest.update(str(path.relative_to(folder)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _read(path: Path) -> dict[str, Any]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    found: dict[str, Any] = {}
    for line in lines:
        try:
            piece = json.loads(line)
            found[piece["name"]] = piece["result"]
        except (ValueError, KeyError, TypeError):
            continue  # cut short while it was written
    return found


PNG_DPI = 160


def write_plot(figure: Figure, stem: Path) -> tuple[Path, Path]:
    """Write ``<stem>.svg`` and ``<stem>.png``; call it inside `plain_style`. Returns both paths."""
    svg, png = (stem.with_name(f"{stem.name}.{kind}") for kind in ("svg", "png"))
    write_text_atomically(svg, svg_text(figure, stem.name))
    figure.set_layout_engine("none")  # laid out for the SVG: all keeps its place
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=PNG_DPI, metadata={"Software": None})
    write_whole(png, buffer.getvalue())
    return svg, png


def write_bound_plots(design: SensorDesign, bounds: PadBounds, folder: Path) -> list[Path]:
    """Location and depth bounds by depth, and the lightest press felt: ``bounds-*.svg`` and ``.png``; their paths."""
    cavity = cavity_of(design)
    written: list[Path] = []
    with plain_style():
        written += write_plot(plot_bound_sheet(bounds, cavity, "location"), folder / "bounds-location")
        written += write_plot(plot_bound_sheet(bounds, cavity, "depth"), folder / "bounds-depth")
        if bounds.felt is not None:
            figure = plot_felt_map(bounds.felt, cavity).get_figure(root=True)
            assert figure is not None
            written += write_plot(figure, folder / "felt-force")
    return written


STEM = "prediction"
"""Of the files of `optopad predict` in a bundle's ``sims`` folder."""
QUICK_PROTOCOL = "piacenza2017-quick"
PRESS_S, PAIR_S = 14e-3, 1.4e-3
"""Processor time of a press, and of each pair under it [s]."""
LEFT_S = 8.0
"""Processor time of all that is not light [s]."""


def quick_prediction_s(design: SensorDesign) -> float | None:
    """Time of `optopad predict DESIGN --quick` on all cores of this machine, nothing known before [s].

    None where the protocol cannot press the design.
    """
    from sims.optics.scene.lower import scene_of
    from sims.optics.scene.symmetry import state_classes
    from sims.readings.press_data import knots_mm

    try:
        protocol = load_protocol_file(QUICK_PROTOCOL).fitted_to(design)
        places = np.unique(np.concatenate(protocol.places_mm(design)), axis=0)
        knots = knots_mm(design, is_coarse=True, deepest_mm=protocol.deepest_mm)
        scene = scene_of(design)
    except (DesignError, InputError, ModelScopeError):
        return None
    distinct = len(state_classes(scene, places[:, None, :], [[1.0]] * len(places)).first)
    pairs = len(scene.emitter_wall) * len(scene.receiver_wall)
    core_s = distinct * (len(knots) - 1) * (PRESS_S + pairs * PAIR_S) + LEFT_S
    return core_s / (os.cpu_count() or 1)
