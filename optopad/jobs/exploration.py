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

import csv
import fcntl
import functools
import io
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from optopad.design.errors import InputError
from optopad.design.files import own_folder, unwritable
from optopad.design.io import dump_design, write_text_atomically
from optopad.design.search.explore import Findings, OnTried, Refine, explore
from optopad.design.search.figures import FIGURES
from optopad.design.search.importance import importances
from optopad.design.search.improve import FanOut, Tried, one_by_one
from optopad.design.search.space import SearchSpace, Value
from optopad.screen.figures import figures_of
from optopad.screen.shown import Search

PLACES = "places.json"
WAY_OUT = "choose another folder with --out"


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
        found = explore(
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
        "designs.csv": table_csv(result, found.tried),
        "front.csv": table_csv(result, found.front),
        "front.json": json.dumps(summary(result), indent=2) + "\n",
        "front.svg": front_svg(found.space, found.base, found.tried, found.front),
        "report.html": search_page(result),
    }
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    return result


def summary(search: Search) -> dict[str, Any]:
    """Result of a search as plain data for JSON."""
    found = search.findings
    return {
        "name": found.space.name,
        "digest": found.space.digest,
        "folder": str(search.folder),
        "report": str(search.folder / "report.html"),
        "sampler": found.space.search.sampler,
        "seed": found.space.search.seed,
        "accuracy": found.space.accuracy,
        "designs": len(found.tried),
        "wanted": found.wanted,
        "stopped_early": sum(bool(one.judged.reason) for one in found.tried),
        "feasible": sum(one.is_feasible for one in found.tried),
        "interrupted": found.is_interrupted,
        "limits": [str(limit) for limit in found.limits],
        "base": {
            "digest": found.space.base.digest,
            "figures": found.base.figures,
            "verdict": found.base.verdict,
            "headline": search.base_headline,
        },
        "front": [
            {
                "number": one.number,
                "digest": one.digest,
                "file": file,
                "parameters": {name: plain(value) for name, value in one.parameters.items()},
                "figures": one.judged.figures,
                "verdict": one.judged.verdict,
                "headline": search.headline(one),
                "is_open": search.is_open(one.judged),
                **figures_of(found.space.design_at(one.parameters), None).size_json(),
            }
            for one, file in zip(found.front, search.files, strict=True)
        ],
        "importance": search.importance,
    }


def plain(value: Any) -> Any:
    """Value of a varied parameter as plain data; for a choice among alternatives, its label."""
    if not isinstance(value, str):
        return value
    return json.loads(value)


def table_csv(search: Search, rows: Sequence[Tried]) -> str:
    """Designs as a CSV table: number, digest, fields, figures, verdict, and the reason of an early stop."""
    found = search.findings
    figures = [name for name in FIGURES if any(name in one.judged.figures for one in found.tried)]
    paths = [field.path for field in found.space.fields]
    front = {one.number for one in found.front}
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(
        [
            "number",
            "digest",
            *paths,
            *figures,
            "verdict",
            "feasible",
            "on_front",
            "seconds",
            "stopped_because",
            "headline",
        ]
    )
    for one in rows:
        values = [one.judged.figures.get(name) for name in figures]
        table.writerow(
            [
                one.number,
                one.digest,
                *(one.parameters[path] for path in paths),
                *("" if value is None else f"{value:.6g}" for value in values),
                one.judged.verdict,
                one.is_feasible,
                one.number in front,
                one.seconds,
                one.judged.reason,
                search.headline(one),
            ]
        )
    return stream.getvalue()


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
    from optopad.fan_out import on_cluster

    with on_cluster(scheduler) as fan_out:
        yield fan_out
