"""Examines this machine: Python, packages, folders and optional programs. Each finding has a fix.

Nothing is installed, and no file remains in a tested folder. Packages are imported in separate processes, so that a
missing shared library or a crash becomes a finding and does not end the examination. Sizes are reported by the
operating system; on Linux a container's memory limit is used (control groups, version 2). Optional programs are only
searched for, not tested.
"""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from design.errors import InputError
from design.files import folder_fault, nearest_existing
from sims.cache import CACHE_VARIABLE, NO_HOME, cache_folder, kernel_folder

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
class Failure:
    """Reason why an import failed, and the fix."""

    reason: str
    way_out: str


@dataclass(frozen=True)
class Package:
    """A declared dependency: name of its distribution, name to import, and oldest version that works."""

    distribution: str
    module: str
    at_least: str


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

DISK_ADVISED_GB = 0.5
"""Recommended disk space [GB]: bundles, the library of solved presses and compiled code each take tens of MB."""

PROBE_LIMIT_S = 60
"""Longest wait for one import [s]; CadQuery alone may take 20 s from a slow disk."""

PACKAGES = (
    Package("cadquery", "cadquery", "2.8"),
    Package("h5netcdf", "h5netcdf", "1.6"),
    Package("h5py", "h5py", "3.12"),
    Package("lz4", "lz4.frame", "4.3"),
    Package("manifold3d", "manifold3d", "3.1"),
    Package("matplotlib", "matplotlib.path", "3.10"),  # compiled, and builds no font list
    Package("mcap", "mcap", "1.5"),
    Package("mcap-ros2-support", "mcap_ros2", "0.5"),
    Package("mujoco", "mujoco", "4.0"),
    Package("numba", "numba", "0.61"),
    Package("numpy", "numpy", "2.1"),
    Package("optuna", "optuna", "5.0"),
    Package("platformdirs", "platformdirs", "4.3"),
    Package("pydantic", "pydantic", "2.10"),
    Package("pyserial", "serial", "3.5"),
    Package("rich", "rich", "13.9"),
    Package("scikit-learn", "sklearn", "1.6"),
    Package("scipy", "scipy", "1.14.1"),
    Package("sqlalchemy", "sqlalchemy", "2.0"),
    Package("threadpoolctl", "threadpoolctl", "3.1"),
    Package("tomlkit", "tomlkit", "0.13"),
    Package("trimesh", "trimesh", "4.6"),
    Package("typer", "typer", "0.15"),
    Package("xarray", "xarray", "2025.1"),
    Package("zstandard", "zstandard", "0.21"),
)

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


def examine(outputs: Path = Path("outputs")) -> list[Requirement]:
    """All findings about this machine, in the order in which problems should be fixed."""
    return [
        python_finding(),
        cpu_finding(),
        memory_finding(),
        *package_findings(),
        kernel_finding(),
        kept_finding("cache folder", cache_folder(), "every run computes everything again"),
        light_finding(),
        temporary_finding(),
        folder_finding("outputs folder", outputs, "run from a folder you can write to, or pass --out FOLDER"),
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


def cpu_finding() -> Requirement:
    """Finding on the number of processors; the light model uses all of them."""
    count = cpu_count()
    if count == 1:
        return Requirement(
            "processors", "warning", "1", "runs take about twice the times stated for 2 processors"
        )
    return Requirement("processors", "ok", str(count))


def memory_gb(limit_file: Path = Path("/sys/fs/cgroup/memory.max")) -> float:
    """Memory that this process may use [GB]: the machine's memory, or the container's limit if it is smaller."""
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = limit_file.read_text().strip() if limit_file.is_file() else "max"
    return min(machine, int(limit) if limit.isdigit() else machine) / 1e9


def memory_finding() -> Requirement:
    """Finding on whether the memory suffices for the CAD solids and the contact model."""
    memory = memory_gb()
    detail = f"{memory:.1f} GB"
    if memory >= MEMORY_ADVISED_GB:
        return Requirement("memory", "ok", detail)
    return Requirement(
        "memory", "warning", detail, f"{MEMORY_ADVISED_GB:g} GB or more is advised; close other programs"
    )


def package_findings() -> Iterator[Requirement]:
    """One finding per declared dependency."""
    failures = import_failures([package.module for package in PACKAGES])
    for package, failure in zip(PACKAGES, failures, strict=True):
        yield package_finding(package, installed_version(package.distribution), failure)


def package_finding(package: Package, version: str, failure: Failure | None) -> Requirement:
    """Finding on one package, from its version ("" if not installed) and the failure of its import (None if none)."""
    if not version:
        return Requirement(package.distribution, "missing", "not installed", INSTALL)
    if failure:
        return Requirement(package.distribution, "missing", f"{version}: {failure.reason}", failure.way_out)
    if release(version) < release(package.at_least):
        detail = f"{version}, needs >= {package.at_least}"
        return Requirement(package.distribution, "missing", detail, INSTALL)
    return Requirement(package.distribution, "ok", version)


def installed_version(distribution: str) -> str:
    """Version of an installed distribution; empty if it is not installed."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ""


def release(version: str) -> tuple[int, ...]:
    """Leading numbers of a version, for comparison: '2.8.0rc1' gives (2, 8, 0)."""
    return tuple(int(number) for number in re.findall(r"(?:^|(?<=\.))\d+", version))


def import_failures(modules: list[str]) -> list[Failure | None]:
    """Import modules in separate processes; returns each module's failure, or None for success.

    Several modules share a process; after a failure, each module gets its own.
    """
    processes = min(cpu_count(), len(modules))
    groups = [modules[number::processes] for number in range(processes)]
    with ThreadPoolExecutor(max_workers=processes) as pool:
        failed = list(pool.map(lambda group: import_failure(*group), groups))
        doubtful = [one for group, why in zip(groups, failed, strict=True) if why for one in group]
        found = dict(zip(doubtful, pool.map(import_failure, doubtful), strict=True))
    return [found.get(module) for module in modules]


def import_failure(*modules: str) -> Failure | None:
    """Import modules in a separate process; return the first failure, or None."""
    command = [sys.executable, "-c", PROBE, *modules]
    try:
        probe = subprocess.run(command, capture_output=True, text=True, timeout=PROBE_LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return Failure(f"its import takes longer than {PROBE_LIMIT_S} s", "try again; the disk may be busy")
    if probe.returncode == 0:
        return None
    marked = [line for line in probe.stdout.splitlines() if line.startswith(PROBE_MARK)]
    if not marked:
        return Failure(f"its import ends the process (exit {probe.returncode})", REINSTALL)
    kind, name, message = marked[-1].removeprefix(PROBE_MARK).split("\t", maxsplit=2)
    error = ModuleNotFoundError if kind == "ModuleNotFoundError" else ImportError
    return diagnose(error(message, name=name))


REINSTALL = "reinstall it: `make clean setup`"
INSTALL = "run `make setup`, or `pip install '.[design]'` in the checkout"

PROBE_MARK = "optopad-probe: "

PROBE = f"""
import importlib, sys
try:
    for module in sys.argv[1:]:
        importlib.import_module(module)
except Exception as err:
    kind = type(err).__name__
    name = err.name if kind == "ModuleNotFoundError" else module
    print("{PROBE_MARK}" + kind, name, " ".join(str(err).split()), sep="\\t")
    sys.exit(3)
"""
"""Program that tests imports in a separate process; on failure it prints the kind of error, module and message."""

MISSING_ON_LINUX = re.compile(r"(?P<file>(?P<stem>lib[\w.+-]+?)\.so[\d.]*): cannot open shared object file")
MISSING_ON_MACOS = re.compile(r"Library not loaded: \S*?(?P<file>(?P<stem>lib[\w+-]+)(?:\.\d+)*\.dylib)")
TOO_OLD_SYSTEM = re.compile(r"version [`'](?P<symbol>(?:GLIBC|GLIBCXX|CXXABI)_[\d.]+)' not found")


def explain_import_error(err: ImportError) -> str:
    """One line for the user: the module that could not be loaded, and the fix."""
    failure = diagnose(err)
    return f"{failure.reason}; {failure.way_out}"


def diagnose(err: ImportError) -> Failure:
    """Find the cause of a failed import: a missing package or system library, an old system, or another error."""
    message, name = str(err), err.name or "a package"
    if isinstance(err, ModuleNotFoundError):
        return Failure(f"the Python package {err.name or message} is not installed", INSTALL)
    if found := MISSING_ON_LINUX.search(message) or MISSING_ON_MACOS.search(message):
        return Failure(f"{name} needs the system library {found['file']}", library_way_out(found["stem"]))
    if found := TOO_OLD_SYSTEM.search(message):
        newer = "use a newer one: glibc 2.31 or later, as in Debian 11 and Ubuntu 20.04"
        return Failure(f"{name} cannot run on this system, which lacks {found['symbol']}", newer)
    return Failure(f"{name} cannot be imported: {message}", REINSTALL)


def library_way_out(stem: str) -> str:
    """Instruction to install the shared library with this name, for example 'libGL'."""
    library = SYSTEM_LIBRARIES.get(stem)
    if library is None:
        return f"install the package of your system that holds it (Debian: `apt-file search {stem}.so`)"
    return (
        f"install the Debian or Ubuntu package {library.debian} (`apt-get install {library.debian}`), "
        f"Fedora {library.fedora}, macOS `brew install {library.homebrew}`"
    )


def folder_finding(name: str, folder: Path, way_out: str, *, state: State = "missing") -> Requirement:
    """Finding on whether files can be written to a folder, and whether its disk has room.

    Parameters
    ----------
    state : state of the finding if the folder cannot be written to
    """
    if fault := folder_fault(folder):
        return Requirement(name, state, f"{folder}: {fault}", way_out)
    free = shutil.disk_usage(nearest_existing(folder)).free / 1e9
    if free < DISK_ADVISED_GB:
        return Requirement(name, "warning", f"{folder}: {free:.2f} GB free", f"free some space, or {way_out}")
    return Requirement(name, "ok", str(folder))


def kept_finding(name: str, folder: Path, lost: str) -> Requirement:
    """Finding on a folder with stored data for later runs, which also work without the folder."""
    way_out = f"set {CACHE_VARIABLE} to a folder you can write to; otherwise {lost}"
    if folder.is_relative_to(NO_HOME):
        return Requirement(name, "warning", "none: this user has no home folder", f"set HOME, or {way_out}")
    return folder_finding(name, folder, way_out, state="warning")


def temporary_finding() -> Requirement:
    """Finding on whether temporary files can be written; mold, firmware and studio need them."""
    way_out = "set TMPDIR to a folder you can write to"
    try:
        return folder_finding("temporary folder", Path(tempfile.gettempdir()), way_out)
    except OSError as err:
        return Requirement("temporary folder", "missing", str(err.strerror), way_out)


def light_finding() -> Requirement:
    """Finding on the stored results of light tracing: their size, how to remove them, how to avoid storing them."""
    from sims.cache import SIZE_VARIABLE, light_store

    try:
        store = light_store()
    except InputError as err:
        return Requirement(
            "light cache", "missing", str(err), f"set {SIZE_VARIABLE} to a number, or unset it"
        )
    if store is None:
        return Requirement("light cache", "ok", f"off: {SIZE_VARIABLE} is 0")
    if folder_fault(store.path.parent):
        return kept_finding("light cache", store.path.parent, "every run traces all light again")
    used_mb = os.path.getsize(store.path) / 1e6 if os.path.isfile(store.path) else 0.0
    held = f"{store.rows()} rows, {used_mb:.1f} of at most {store.size_mb:g} MB"
    return Requirement(
        "light cache", "ok", f"{held}, in {store.path} (delete it to clear; {SIZE_VARIABLE}=0: off)"
    )


def kernel_finding() -> Requirement:
    """Finding on whether the compiled code of the light model is stored for later processes."""
    return kept_finding("kernel cache", kernel_folder(), "every run compiles the kernels again")


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
