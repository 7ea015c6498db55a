"""Architecture guards: what each room may import, what every file must keep to."""

from __future__ import annotations

import ast
import importlib
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from optopad import __version__
from tests.rooms import (
    FLOORS,
    arrows,
    circle,
    folders,
    imports,
    tree_of,
    upward,
)

ROOT = Path(__file__).parents[1]
ROOMS = ("design", "cad", "sims", "fabrication", "optopad")
HEAVY = (
    "cadquery",
    "OCP",
    "mujoco",
    "numba",
    "matplotlib",
    "optuna",
    "scipy",
    "sklearn",
    "trimesh",
    "xarray",
)

ALLOWED = {
    "design": {
        "pydantic",
        "pydantic_core",
        "numpy",
        "optuna",
        "sqlalchemy",
        "tomli",
        "tomlkit",
        "h5py",
        "trimesh",
        "xarray",
    },
    "cad": {"cadquery", "OCP", "trimesh", "manifold3d", "numpy"},
    "sims": {
        "numpy",
        "xarray",
        "h5netcdf",
        "h5py",
        "matplotlib",
        "platformdirs",
        "scipy",
        "numba",
    },  # numba tells when it compiles
    "sims/contact": {"mujoco", "numpy", "scipy", "platformdirs", "threadpoolctl"},
    "sims/optics": {
        "numba",
        "numpy",
        "scipy",
    },  # scipy lowers a profile to cubic pieces and draws Sobol points
    "sims/learning": {"numpy", "scipy", "sklearn", "threadpoolctl"},
    "sims/learning/inference": {"numpy"},
    "sims/robot": {"numpy", "scipy", "threadpoolctl"},
    "fabrication/board": {
        "numba",
        "numpy",
        "scipy",
    },  # the router is compiled; the pour is in connected pieces
    "fabrication": {"jinja2", "markupsafe", "numpy", "pydantic", "tomlkit"},
    "fabrication/driver": {
        "serial",
        "numpy",
        "xarray",
        "h5netcdf",
        "h5py",
        "lz4",
        "mcap",
        "mcap_ros2",
        "pandas",
        "pyarrow",
        "zstandard",
    },
    "fabrication/scene": {"mujoco", "numpy", "scipy"},
    "fabrication/stage": {"numpy"},
    "optopad/studio/view": {"viser", "websockets", "msgspec", "numpy"},  # both are what viser speaks with
    "optopad": {
        *(
            "distributed",
            "gymnasium",
            "markdown_it",
            "markupsafe",
            "matplotlib",
            "numba",
            "numpy",
            "platformdirs",
            "rich",
            "tomlkit",
            "typer",
            "xarray",
        )
    },
}
"""Third-party imports, the nearest folder deciding. OCP is CadQuery's core, pydantic_core is pydantic's."""

MACHINE_PATH = re.compile(
    r"(?<![\w.])/(?:home|root|tmp|work|Users|mnt|opt)/(?!ros/)\w|[A-Z]:\\{1,2}Users", re.ASCII
)
"""A path that exists on one machine only. The folder of ROS is the same on all."""

FOR_ROS = "fabrication/ros2/optopad_ros/"
"""A package of ROS 2, which is copied into a workspace and imported there."""
SHAPE_ROOMS = ("design/spec/", "design/shape/", "cad/lid")
"""Where names of shapes may stand: the design file's own words, the room of shapes, and the lid that casts a crown."""
SHAPE_NAMES = re.compile(
    r"""["'](?:disc|stadium)["']|\bis_(?:disc|stadium|flat_rectangle)\b|\bcrown is (?:not )?None|\bdesign\.crown\b"""
)

REFUSED_MODULES = {"pickle", "cPickle", "dill", "joblib", "cloudpickle", "shelve", "marshal"}
REFUSED_CALLS = {"eval", "exec"}
CODE_WORDS = re.compile("|".join([*sorted(REFUSED_MODULES | REFUSED_CALLS), "allow_pickle"]))
"""A file without any of these need not be parsed."""


def python_files(*folders: str) -> list[Path]:
    found = sorted(path for folder in folders for path in (ROOT / folder).rglob("*.py"))
    return [path for path in found if not name_of(path).startswith(FOR_ROS)]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imported_modules(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            yield node.module


def third_party(tree: ast.Module) -> set[str]:
    tops = {module.partition(".")[0] for module in imported_modules(tree)}
    for_types = {"typing_extensions"}  # comes with mypy, and nothing else imports it
    return tops - set(sys.stdlib_module_names) - set(ROOMS) - for_types


def room_of(path: Path) -> str:
    parents = (folder.as_posix() for folder in path.relative_to(ROOT).parents)
    return next(folder for folder in parents if folder in ALLOWED)


def run_python(program: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("room", ROOMS)
def test_each_room_is_the_one_of_this_repository(room: str) -> None:
    name = room if room == "optopad" else f"optopad.{room}"
    module = importlib.import_module(name)
    assert module.__file__ is not None
    assert Path(module.__file__) == ROOT.joinpath(*name.split("."), "__init__.py")
    assert Path(module.__file__).resolve() == ROOT / room / "__init__.py"


def test_no_room_but_that_of_shapes_asks_what_shape_a_pad_has() -> None:
    asked = {
        f"{name_of(path)}: {found.group()}"
        for path in python_files(*ROOMS)
        if not name_of(path).startswith(SHAPE_ROOMS)
        and (found := SHAPE_NAMES.search(path.read_text(encoding="utf-8")))
    }
    assert not asked


def text_files() -> Iterator[Path]:
    for folder in (*ROOMS, "tests", "docs", ".ci"):
        files = (path for path in (ROOT / folder).rglob("*") if path.is_file())
        yield from (path for path in files if "__pycache__" not in path.parts)
    yield from (path for path in ROOT.iterdir() if path.suffix in {".md", ".toml"})
    yield from (ROOT / "Makefile", ROOT / "constraints.txt")


def test_no_text_names_a_path_of_one_machine() -> None:
    texts = {name_of(path): path.read_bytes().decode("utf-8", errors="ignore") for path in text_files()}
    assert {name: found[0] for name, text in texts.items() if (found := MACHINE_PATH.search(text))} == {}


def loads_or_runs_code(tree: ast.Module) -> set[str]:
    modules = {module.partition(".")[0] for module in imported_modules(tree)}
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    names = {call.func.id for call in calls if isinstance(call.func, ast.Name)}
    pickles = (keyword for call in calls for keyword in call.keywords if keyword.arg == "allow_pickle")
    keywords = {ast.unparse(keyword) for keyword in pickles}
    return modules & REFUSED_MODULES | names & REFUSED_CALLS | keywords & {"allow_pickle=True"}


def test_nothing_loads_or_runs_code_from_data() -> None:
    suspect = [
        path for path in python_files(*ROOMS, "tests") if CODE_WORDS.search(path.read_text(encoding="utf-8"))
    ]
    found = {name_of(path): loads_or_runs_code(tree_of(path)) for path in suspect}
    assert {name: words for name, words in found.items() if words} == {}


def test_a_room_imports_only_the_libraries_it_is_allowed() -> None:
    strangers = {
        name_of(path): third_party(tree_of(path)) - ALLOWED[room_of(path)] for path in python_files(*ROOMS)
    }
    assert {name: libraries for name, libraries in strangers.items() if libraries} == {}


def test_every_library_that_a_room_imports_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = (
        project["dependencies"]
        + extras["design"]
        + extras["cluster"]
        + extras["gym"]
        + extras["studio"]
        + extras["lerobot"]
    )
    declared = {re.split(r"[<>=]", line)[0] for line in wanted} | {
        "OCP",
        "markdown_it",
        "mcap_ros2",
        "pydantic_core",
        "serial",
        "sklearn",
    }  # parts of others; markdown-it-py; mcap-ros2-support; pyserial; scikit-learn
    used = set().union(*(third_party(tree_of(path)) for path in python_files(*ROOMS)))
    assert used <= declared


def test_pins_are_plain_and_cover_every_declared_dependency() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert [line for line in pins if not re.fullmatch(r"[\w.-]+==[\w.!+]+(; \S.*)?", line)] == []
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = project["dependencies"] + extras["design"] + extras["dev"]
    wanted = [line for line in wanted if "python_version" not in line]  # for a Python without pins
    names = {line.partition("==")[0].lower() for line in pins}
    assert {re.split(r"[<>=]", line)[0].lower() for line in wanted} <= names


def test_the_arrows_between_the_rooms_hold() -> None:
    program = (
        "import sys; from importlinter.cli import lint_imports; "
        "sys.exit(lint_imports(config_filename='pyproject.toml', no_cache=True))"
    )
    result = run_python(program)
    assert result.returncode == 0, result.stdout + result.stderr


def test_no_file_imports_itself_by_way_of_others() -> None:
    edges = [(".".join(place), ".".join(other)) for place, others in imports().items() for other in others]
    assert circle(edges) == []


def test_the_measure_finds_a_circle() -> None:
    assert set(circle([("a", "b"), ("b", "c"), ("c", "a"), ("c", "d")])) == {"a", "b", "c"}


@pytest.mark.parametrize("folder", folders(), ids="/".join)
def test_the_rooms_of_a_folder_make_no_circle_and_no_arrow_rises(folder: tuple[str, ...]) -> None:
    assert circle(arrows(folder)) == []
    assert upward(folder) == []


def test_every_room_that_stands_on_a_floor_is_there() -> None:
    rooms = {f"{folder}/{room}".strip("/") for folder, names in FLOORS.items() for room in names}
    assert [
        room for room in sorted(rooms) if not any((ROOT / f"{room}{end}").exists() for end in ("", ".py"))
    ] == []


def test_every_place_that_the_map_names_is_there() -> None:
    page = (ROOT / "docs" / "understand" / "architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:design|cad|sims|fabrication|optopad|tests|docs)/[\w/.]*)`", page)
    assert len(named) > 40
    assert [name for name in named if not (ROOT / name).exists()] == []


@pytest.mark.parametrize("words", [["--help"], ["check", "piacenza2017-pair"]], ids=" ".join)
def test_help_and_check_load_no_heavy_library(words: list[str]) -> None:
    # Style asks for help in half a second of CPU. Clocks of shared machines are noisy, the list of loaded
    # modules is not: each of these takes 0.1 to 3 s, and without them the command line is well below that.
    program = (
        f"import json, sys; sys.argv = ['optopad', *{words!r}]\n"
        "from optopad.cli import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        f"print(json.dumps([name for name in {HEAVY} if name in sys.modules]))"
    )
    result = run_python(program)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout.splitlines()[-1]) == []


def test_the_version_is_that_of_the_newest_release_in_the_changelog() -> None:
    released = re.findall(
        r"^## \[(\d[^]]*)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.M
    )
    assert released[0] == __version__
