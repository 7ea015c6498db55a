"""The rooms of the house: what each folder holds and imports, measured from the code.

    python -m tests.rooms          per folder: files, lines, the rooms that it imports
    python -m tests.rooms --draw   docs/images/architecture.svg, the map of docs/understand/architecture.md

A room is a folder, or a file that lies beside folders. `FLOORS` says in which order the rooms of a folder stand, from
the ground up; code imports from below, never from above.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
HOUSE = ("design", "cad", "sims", "fabrication", "optopad")

FLOORS: dict[str, tuple[str, ...]] = {
    "": ("design", "cad", "sims", "fabrication", "optopad"),
    "design": (
        "errors",
        "fields",
        "parts",
        "spec",
        "shape",
        "mold",
        "circuit",
        "rules",
        "search",
    ),
    "sims": (
        *(
            "press",
            "cache",
            "kernels",
            "contact",
            "optics",
            "rays",
            "readings",
            "verdict",
            "bounds",
            "score",
        ),
        *("learning", "plots"),
    ),
    "sims/contact": ("wedge", "walls", "library", "indentation", "pad_surface", "held"),
    "sims/optics": ("scene", "surface", "engine", "paths", "tracing"),
    "sims/optics/engine": (
        "straight",
        "mirrored",
        "scattered",
        "general",
        "states",
        "compiled",
        "trace_states",
    ),
    "sims/learning": ("inference", "samples", "learners", "calibration"),
    "fabrication": ("driver_file", "sketch", "driver_config", "sheets", "ros2", "driver", "stage"),
    "fabrication/driver": ("link", "simulated", "recording", "stream", "sensor", "observations"),
    "optopad": ("work", "screen", "report", "bundle_parts", "sensor", "studio", "cli", "verbs", "api"),
    "optopad/report": ("words", "scenes", "sections", "page"),
    "optopad/studio": ("session", "workshop", "live", "view"),
}
"""From the ground up; of files beside folders only those that a floor needs."""

Place = tuple[str, ...]
"""A module as its path without suffix: ("design", "spec", "sensor"). A package's own file ends in "__init__"."""


@cache
def modules() -> dict[Place, Path]:
    """Every module of the house."""
    paths = (path for room in HOUSE for path in (ROOT / room).rglob("*.py"))
    ours = (path for path in sorted(paths) if "optopad_ros" not in path.parts)  # a package of ROS 2
    return {path.relative_to(ROOT).with_suffix("").parts: path for path in ours}


@cache
def tree_of(path: Path) -> ast.Module:
    """Read once for all tests, which look and do not change."""
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def _resolved(name: str) -> Place | None:
    """The module that a dotted name means, or lies in; None outside the house.

    ``optopad.design`` and its neighbours are links to the folders at the top level.
    """
    parts = tuple(name.split("."))
    parts = parts[1:] if parts[0] == "optopad" and parts[1:2] and parts[1] in HOUSE else parts
    while parts:
        for place in (parts, (*parts, "__init__")):
            if place in modules():
                return place
        parts = parts[:-1]
    return None


def _names(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def imports() -> dict[Place, frozenset[Place]]:
    """What each module imports of the house, lazily or for its types as well."""
    found = {}
    for place, path in modules().items():
        names = _names(tree_of(path))
        found[place] = frozenset(other for name in names if (other := _resolved(name)) not in (None, place))
    return found


def folders() -> list[Place]:
    """Every folder of modules, the whole house as ()."""
    return sorted({place[:depth] for place in modules() for depth in range(len(place))})


def _room(place: Place, folder: Place) -> str | None:
    """The room of a folder in which a module lies; None for the folder's door and for what lies elsewhere."""
    inside = len(place) > len(folder) and place[: len(folder)] == folder
    return place[len(folder)] if inside and place[len(folder)] != "__init__" else None


def arrows(folder: Place) -> dict[tuple[str, str], list[str]]:
    """Which room of a folder imports which other one, and by which modules."""
    found: dict[tuple[str, str], list[str]] = {}
    for place, others in imports().items():
        room = _room(place, folder)
        for other in others if room else ():
            target = _room(other, folder)
            if room and target and target != room:
                found.setdefault((room, target), []).append(f"{'.'.join(place)} -> {'.'.join(other)}")
    return found


def circle(edges: Iterable[tuple[str, str]]) -> list[str]:
    """Rooms that import each other in a circle, the first again at the end; empty where there is none."""
    graph: dict[str, set[str]] = {}
    for start, end in edges:
        graph.setdefault(start, set()).add(end)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as err:
        return list(err.args[1])
    return []


def upward(folder: Place) -> list[str]:
    """Arrows of a folder that rise from a floor to a higher one."""
    floors = FLOORS.get("/".join(folder), ())
    height = {room: number for number, room in enumerate(floors)}
    return [
        why
        for (room, target), whys in arrows(folder).items()
        if room in height and target in height and height[target] > height[room]
        for why in whys
    ]


def files_in(folder: Path) -> list[Path]:
    """The files that lie in a folder itself."""
    return sorted(path for path in folder.iterdir() if path.is_file() and path.suffix != ".pyc")


def lines_of(path: Path) -> int:
    """Lines of a text file; 0 of any other."""
    try:
        return len(path.read_text(encoding="utf-8").splitlines())
    except UnicodeDecodeError:
        return 0


def imported_rooms(folder: Place) -> list[str]:
    """The folders that the files of a folder itself import."""
    own = [place for place in modules() if place[:-1] == folder]
    targets = {"/".join(other[:-1]) for place in own for other in imports()[place]}
    return sorted(targets - {"/".join(folder)})


def table() -> str:
    """A row a folder: files, lines, imports out."""
    rows = []
    for folder in folders():
        files = files_in(ROOT.joinpath(*folder)) if folder else []
        if files:
            out = ", ".join(imported_rooms(folder)) or "-"
            rows.append(f"{'/'.join(folder):34} {len(files):5} {sum(map(lines_of, files)):6}  {out}")
    lines = sum(map(lines_of, modules().values()))
    whole = f"{len(rows)} folders, {len(modules())} modules, {lines} lines of Python"
    return "\n".join([f"{'folder':34} {'files':>5} {'lines':>6}  imports", *rows, whole])


if __name__ == "__main__":
    if sys.argv[1:] == ["--draw"]:
        from tests.house_map import PICTURE, picture

        PICTURE.write_text(picture(), encoding="utf-8")
        print(f"written: {PICTURE.relative_to(ROOT)}")
    else:
        print(table())
