"""Runs a search for better designs, and writes its results into a folder.

outputs/<name>-<digest8>/
  space.json       the search space as it was read
  places.json      locations that are evaluated on each pad in addition to the map's, if there are any
  study.db         every evaluated design (SQLite; missing if --storage names another database)
  designs.csv      these designs, with figures and the reasons why some were stopped early
  front.csv .json  the Pareto front
  front.svg        a picture of the front
  designs/         the front as design files
  report.html      all results on one page
"""

from __future__ import annotations

import fcntl
import functools
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from os import PathLike
from pathlib import Path
from typing import Any

from optopad.cli.verb import LARGEST_SEED, typed, verb
from optopad.design.errors import InputError, OptopadError
from optopad.design.files import own_folder, unwritable
from optopad.design.io import dump_design, write_text_atomically
from optopad.design.search.explore import Findings, OnTried, Refine, importances
from optopad.design.search.explore import explore as explored
from optopad.design.search.improve import FanOut, Judged, Limit, Objective, one_by_one
from optopad.design.search.space import SearchSpace, Value, load_space, space_from
from optopad.design.spec import SensorDesign
from optopad.screen.search import Search
from optopad.work import OUT, parsed_change

PLACES = "places.json"
WAY_OUT = "choose another folder with --out"
CONNECT_TIMEOUT_S = 10


@verb(
    space=typed("SPACE"),
    trials=typed(min=1),
    storage=typed("URL"),
    scheduler=typed("ADDRESS"),
    seed=typed(min=0, max=LARGEST_SEED),
)
def explore(
    space: str,
    *,
    trials: int | None = None,
    storage: str | None = None,
    scheduler: str | None = None,
    set_: Sequence[str] = (),
    out: str | PathLike[str] = OUT,
    seed: int | None = None,
    on_tried: OnTried | None = None,
) -> Search:
    """Search a space of designs for the best ones; the same command continues a search.

    Parameters
    ----------
    space : Search-space file (.toml), or the name of a packaged one.
    trials : Designs to judge, those of earlier runs included.
    storage : Database that many workers share, as postgresql://user@host/name.
    scheduler : Dask scheduler whose workers judge, as tcp://host:8786.
    seed : Seed of the search; default: the space's.
    """
    read = load_space(space)
    document = read.model_dump(mode="json")
    if set_:
        base = read.base.with_(**dict(parsed_change(change) for change in set_))
        document |= {"base": base.model_dump(mode="json")}
    if seed is not None:
        document["search"] |= {"seed": seed}
    if set_ or seed is not None:
        read = space_from(document, where=space)
    return search(read, Path(out), trials=trials, storage=storage, scheduler=scheduler, on_tried=on_tried)


def search_folder(space: SearchSpace, out: Path) -> Path:
    """Folder of a search, named after the search and the first 8 digits of its digest."""
    return out / f"{space.name}-{space.digest[:8]}"


def search(
    space: SearchSpace,
    out: Path,
    *,
    trials: int | None = None,
    storage: str | None = None,
    scheduler: str | None = None,
    on_tried: OnTried | None = None,
    first: Sequence[dict[str, Value]] = (),
    refine: Refine | None = None,
    also_mm: Sequence[tuple[float, float]] = (),
) -> Search:
    """Start or continue a search, and write its results.

    Parameters
    ----------
    trials : total number of designs to evaluate; if None, the number in the search space
    storage : address of a database that several workers may share; if None, SQLite in the search's folder is used
    scheduler : address of a Dask scheduler whose workers evaluate the designs; if None, this process does
    first : points of the search space to evaluate before the sampler proposes points
    refine : function that proposes further points to evaluate after the sampler's points
    also_mm : (x, y) of locations to evaluate on each pad in addition to the map's [mm]; a continued search keeps its
        first ones

    Raises
    ------
    InputError, DesignError, OutputError : the input is invalid, or files cannot be written; finished designs are
        stored.
    """
    from optopad.design.shape.cavity import cavity_of
    from optopad.sims.score.objective import judge, price_of

    if any(objective.figure == "cost" for objective in space.objectives):
        price_of(cavity_of(space.base))  # refuses before the folder is made
    folder = search_folder(space, out)
    own_folder(own_folder(folder, WAY_OUT) / "designs", WAY_OUT)
    further = _further_places(folder, also_mm)
    url = storage or f"sqlite:///{(folder / 'study.db').absolute()}"
    objective = functools.partial(
        judge, wanted=figures_wanted(space), accuracy=space.accuracy, also_mm=further
    )
    with _alone(folder) if storage is None else nullcontext(), _fanning_out(scheduler) as fan_out:
        found = explored(
            space,
            objective,
            url,
            trials=trials,
            is_shared=storage is not None,
            fan_out=fan_out,
            on_tried=on_tried,
            first=first,
            refine=refine,
        )
        return write_search(folder, found, importances(space, url))


def figures_wanted(space: SearchSpace) -> tuple[str, ...]:
    """Names of the figures to compute in addition to those in constraints: objectives, strength and usable depth.

    The usable depth is left out if no other figure needs the map of a pad, because the map takes most of the time.
    """
    from optopad.design.shape.cavity import cavity_of, is_facing_rows
    from optopad.sims.score.objective import MAP_FIGURES

    objectives = tuple(objective.figure for objective in space.objectives)
    needed = {*objectives, *(constraint.figure for constraint in space.constraints)}
    has_depth = bool(needed & MAP_FIGURES) or is_facing_rows(cavity_of(space.base))
    return (*objectives, "strength", *(("usable_depth_mm",) if has_depth else ()))


def _further_places(folder: Path, wanted: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Locations at which designs are evaluated in addition to the map's, as given when the search began [mm]."""
    file = folder / PLACES
    if not file.exists():
        known = [] if (folder / "study.db").exists() else [list(place) for place in wanted]
        if known:
            write_text_atomically(file, json.dumps(known) + "\n")
        return tuple((x, y) for x, y in known)
    try:
        return tuple((float(x), float(y)) for x, y in json.loads(file.read_text(encoding="utf-8")))
    except (ValueError, TypeError, RecursionError):
        raise InputError(
            f"{file}: damaged; remove the folder {folder}, or choose another with --out"
        ) from None


def write_search(folder: Path, found: Findings, importance: dict[str, dict[str, float]]) -> Search:
    """Write tables, designs, picture and page of a search into its folder."""
    from optopad.report.search import search_page
    from optopad.sims.plots.front import front_svg

    files = _write_designs(folder / "designs", found)
    result = Search(folder=folder, findings=found, files=files, importance=importance)
    texts = {
        "space.json": json.dumps(found.space.model_dump(mode="json"), indent=2) + "\n",
        "designs.csv": result.to_csv(found.tried),
        "front.csv": result.to_csv(found.front),
        "front.json": json.dumps(result.to_json(), indent=2) + "\n",
        "front.svg": front_svg(found.space, found.base, found.tried, found.front),
        "report.html": search_page(result),
    }
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    return result


def _write_designs(folder: Path, found: Findings) -> tuple[str, ...]:
    names = []
    for one in found.front:
        name = f"{one.number:04d}-{one.digest[:8]}.toml"
        write_text_atomically(folder / name, dump_design(found.space.design_at(one.parameters)))
        names.append(f"designs/{name}")
    for left in folder.glob("*.toml"):
        if f"designs/{left.name}" not in names:
            left.unlink(missing_ok=True)
    return tuple(names)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    try:
        descriptor = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as err:
        raise unwritable(folder, err, WAY_OUT) from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise InputError(
            f"{folder}: another process is searching in this folder; wait for it, or share a database "
            "among workers with --storage"
        ) from None
    finally:
        os.close(descriptor)


@contextmanager
def _fanning_out(scheduler: str | None) -> Iterator[FanOut]:
    if scheduler is None:
        yield one_by_one
        return
    with on_cluster(scheduler) as fan_out:
        yield fan_out


@contextmanager
def on_cluster(address: str) -> Iterator[FanOut]:
    """Yield a function that scores designs on the workers of a Dask scheduler, whose address may be tcp://127.0.0.1:8786.

    Designs are sent in batches, and results return in any order. If a worker dies, the scheduler gives its designs to
    another worker. The light model uses all processors of a worker, so each worker should have one thread
    (`dask worker --nthreads 1`).

    Raises
    ------
    InputError : the package `distributed` is missing, no scheduler replies, the scheduler has no workers, or the
        connection is lost.
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
            f"--scheduler: no scheduler replies at {address!r}: {reason}; start one with `dask scheduler`"
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
                f"--scheduler: workers of {address} crash on one design ({err.last_worker}); see their "
                "logs: memory is the usual cause (finished designs are kept)"
            ) from None
        except (CancelledError, OSError, TimeoutError) as err:
            raise InputError(
                f"--scheduler: {address} was lost: {err or type(err).__name__}; finished designs are "
                "kept: start it again and repeat the command"
            ) from None

    return fan_out
