"""Examines this machine for a bug report: versions, processors, memory, cache, compiler, optional programs.

Nothing is installed. On Linux a container's memory limit is used (control groups, version 2). Optional programs are
only searched for, not tested. The module also explains failed imports.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from optopad.design.files import folder_fault
from optopad.sims.cache import CACHE_VARIABLE, NO_HOME, cache_folder, kernel_folder

State = Literal["ok", "missing", "warning"]


@dataclass(frozen=True)
class Requirement:
    """One result of the examination of this machine.

    The state `missing` prevents `optopad run`; `warning` costs time or an optional step.
    """

    name: str
    state: State
    detail: str
    way_out: str = ""


@dataclass(frozen=True)
class SystemLibrary:
    """Names of the packages that contain a shared library, on Debian and on Fedora."""

    debian: str
    fedora: str
    homebrew: str


@dataclass(frozen=True)
class Tool:
    """An optional program, with the alternative names of its command.

    `debian` is the Debian package that contains the program; "" if there is none.
    """

    commands: tuple[str, ...]
    purpose: str
    debian: str


PYTHON_RANGE = ((3, 11), (3, 14))
"""First version of Python that the commands support, and first version after it that is not supported.

The driver alone runs on Python 3.10, too.
"""

MEMORY_ADVISED_GB = 2.0
"""Recommended memory [GB]: importing CadQuery and MuJoCo takes 0.5 GB, and a run adds meshes and matrices."""

VERSIONS = ("optopad", "numpy", "scipy", "numba", "cadquery", "mujoco", "pydantic", "scikit-learn", "xarray")
"""Packages whose versions results depend on."""

SYSTEM_LIBRARIES = {
    "libEGL": SystemLibrary("libegl1", "libglvnd-egl", "mesa"),
    "libGL": SystemLibrary("libgl1", "libglvnd-glx", "mesa"),
    "libGLX": SystemLibrary("libglx0", "libglvnd-glx", "mesa"),
    "libGLdispatch": SystemLibrary("libglvnd0", "libglvnd", "mesa"),
    "libX11": SystemLibrary("libx11-6", "libX11", "libx11"),
    "libexpat": SystemLibrary("libexpat1", "expat", "expat"),
    "libgomp": SystemLibrary("libgomp1", "libgomp", "libomp"),
    "libstdc++": SystemLibrary("libstdc++6", "libstdc++", "gcc"),
    "libxcb": SystemLibrary("libxcb1", "libxcb", "libxcb"),
    "libz": SystemLibrary("zlib1g", "zlib", "zlib"),
}

TOOLS = (
    Tool(
        ("prusa-slicer", "PrusaSlicer", "prusa-slicer-console"),
        "slicing the printed parts (build --slice)",
        "prusa-slicer",
    ),
    Tool(("avr-gcc",), "compiling the firmware for an AVR board", "gcc-avr avr-libc"),
    Tool(("avrdude",), "flashing the firmware onto an AVR board", "avrdude"),
    Tool(("arduino-cli",), "flashing the firmware onto a board that is no AVR", ""),
    Tool(("simavr",), "running the compiled firmware without a board", "simavr"),
    Tool(
        ("chromium", "chromium-browser", "google-chrome"), "drawing the report page in its test", "chromium"
    ),
)


def examine() -> list[Requirement]:
    """All findings about this machine, in the order in which problems should be fixed."""
    return [
        python_finding(),
        Requirement("platform", "ok", platform.platform()),
        Requirement("processors", "ok", str(cpu_count())),
        memory_finding(),
        *(version_finding(name) for name in VERSIONS),
        dependency_finding(),
        kernel_finding(),
        cache_finding(),
        *(tool_finding(tool) for tool in TOOLS),
    ]


def python_finding(version: tuple[int, ...] = sys.version_info[:3]) -> Requirement:
    """Finding on whether the dependencies support this version of Python."""
    first, beyond = PYTHON_RANGE
    detail = ".".join(map(str, version))
    if first <= version < beyond:
        return Requirement("python", "ok", detail)
    way_out = f"install Python {first[0]}.{first[1]} to {beyond[0]}.{beyond[1] - 1}, then `make clean setup`"
    return Requirement("python", "missing", detail, way_out)


def cpu_count() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory_gb(limit_file: Path = Path("/sys/fs/cgroup/memory.max")) -> float:
    """Memory that this process may use [GB]: the machine's memory, or the container's limit if it is smaller."""
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = limit_file.read_text().strip() if limit_file.is_file() else "max"
    return min(machine, int(limit) if limit.isdigit() else machine) / 1e9


def memory_finding() -> Requirement:
    """Finding on whether the memory suffices for the CAD solids and the contact model."""
    memory = memory_gb()
    if memory >= MEMORY_ADVISED_GB:
        return Requirement("memory", "ok", f"{memory:.1f} GB")
    way_out = f"{MEMORY_ADVISED_GB:g} GB or more is advised; close other programs"
    return Requirement("memory", "warning", f"{memory:.1f} GB", way_out)


def version_finding(distribution: str) -> Requirement:
    """Finding on the version of an installed distribution."""
    try:
        return Requirement(distribution, "ok", importlib.metadata.version(distribution))
    except importlib.metadata.PackageNotFoundError:
        return Requirement(distribution, "missing", "not installed", INSTALL)


def dependency_finding() -> Requirement:
    """Finding of `pip check`: whether the installed packages have the versions that they need of each other."""
    done = subprocess.run([sys.executable, "-m", "pip", "check"], capture_output=True, text=True, check=False)
    said = "; ".join((done.stdout or done.stderr).strip().splitlines()[:3])
    if done.returncode == 0:
        return Requirement("pip check", "ok", said)
    return Requirement("pip check", "warning", said, INSTALL)


INSTALL = "run `make setup`, or `pip install '.[design]'` in the checkout"
REINSTALL = "reinstall it: `make clean setup`"


def kernel_finding() -> Requirement:
    """Finding on whether numba compiles, and where compiled code of the light model is stored."""
    try:
        from numba import njit

        njit(lambda value: value + 1)(1)
    except ImportError as err:
        return Requirement("kernels", "missing", "do not compile", explain_import_error(err))
    except Exception as err:
        return Requirement("kernels", "missing", f"do not compile: {err}", REINSTALL)
    return folder_finding("kernels", kernel_folder(), "every run compiles the kernels again")


def cache_finding() -> Requirement:
    """Finding on the folder in which results are stored for later runs, which also work without it."""
    return folder_finding("cache", cache_folder(), "every run computes everything again")


def folder_finding(name: str, folder: Path, lost: str) -> Requirement:
    """Finding on a folder with stored data: its location and its size."""
    way_out = f"set {CACHE_VARIABLE} to a folder you can write to; otherwise {lost}"
    if folder.is_relative_to(NO_HOME):
        return Requirement(name, "warning", "none: this user has no home folder", f"set HOME, or {way_out}")
    if fault := folder_fault(folder):
        return Requirement(name, "warning", f"{folder}: {fault}", way_out)
    size = 0
    for file in folder.rglob("*"):
        with suppress(OSError):  # another process has just removed it
            size += file.stat().st_size if file.is_file() else 0
    return Requirement(name, "ok", f"{folder}, {size / 1e6:.1f} MB")


MISSING_ON_LINUX = re.compile(r"(?P<file>(?P<stem>lib[\w.+-]+?)\.so[\d.]*): cannot open shared object file")
MISSING_ON_MACOS = re.compile(r"Library not loaded: \S*?(?P<file>(?P<stem>lib[\w+-]+)(?:\.\d+)*\.dylib)")
TOO_OLD_SYSTEM = re.compile(r"version [`'](?P<symbol>(?:GLIBC|GLIBCXX|CXXABI)_[\d.]+)' not found")


def explain_import_error(err: ImportError) -> str:
    """One line for the user: the module that could not be loaded, and the fix."""
    message, name = str(err), err.name or "a package"
    if isinstance(err, ModuleNotFoundError):
        return f"the Python package {err.name or message} is not installed; {INSTALL}"
    if found := MISSING_ON_LINUX.search(message) or MISSING_ON_MACOS.search(message):
        return f"{name} needs the system library {found['file']}; {library_way_out(found['stem'])}"
    if found := TOO_OLD_SYSTEM.search(message):
        newer = "use a newer one: glibc 2.31 or later, as in Debian 11 and Ubuntu 20.04"
        return f"{name} cannot run on this system, which lacks {found['symbol']}; {newer}"
    return f"{name} cannot be imported: {message}; {REINSTALL}"


def library_way_out(stem: str) -> str:
    """Instruction to install the shared library with this name, for example 'libGL'."""
    library = SYSTEM_LIBRARIES.get(stem)
    if library is None:
        return f"install the package of your system that holds it (Debian: `apt-file search {stem}.so`)"
    return (
        f"install the Debian or Ubuntu package {library.debian} (`apt-get install {library.debian}`), "
        f"Fedora {library.fedora}, macOS `brew install {library.homebrew}`"
    )


def tool_finding(tool: Tool) -> Requirement:
    """Finding on whether an optional program is on the search path."""
    name = tool.commands[0]
    found = next(filter(None, map(shutil.which, tool.commands)), None)
    if found:
        return Requirement(name, "ok", f"{found}, for {tool.purpose}")
    return Requirement(
        name,
        "warning",
        f"not found; only {tool.purpose} needs it",
        f"Debian: apt-get install {tool.debian}"
        if tool.debian
        else "no package of Debian: see its maker's page",
    )
