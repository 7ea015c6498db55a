"""Writes bundles: the output folders of designs, which are never left half-written.

A command works in a hidden folder next to the bundle, into which it first copies the bundle's files. At the end the
command writes the manifest, flushes everything to the disk, and swaps the two folders. If the computer stops during
the swap, the next command that writes to the bundle restores it.

The manifest says of every file which inputs it was made from: the part of the design, the seed, the settings and the
program, each set named by its digest. A part whose inputs are the same and whose files are intact need not be made
again (`current_files`).

Several commands, processes and threads may work on one bundle at a time. Each has its own hidden folder, which is
locked while it is in use. Before the swap, files that other commands have finished in the meantime are copied into the
hidden folder. If two commands wrote the same file, the version of the later swap remains. Only one command at a time
copies or swaps folders; the others wait.

A symbolic link in place of the bundle, or of a folder that commands write into, is refused.

    outputs/<name>-<digest8>/                     the bundle
    outputs/.<name>-<digest8>.<random>.partial/   work in progress
    outputs/.<name>-<digest8>.old/                the former bundle, during the swap only
"""

from __future__ import annotations

import glob
import hashlib
import json
import os
import platform
import re
import secrets
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from optopad.design.errors import InputError, OutputError
from optopad.design.files import alone_in, locked, unwritable
from optopad.design.io import save_design, write_text_atomically
from optopad.design.spec import SensorDesign

MANIFEST = "manifest.json"
FOLDERS = ("cad", "fabrication", "scene", "sims")
"""Subfolders of a bundle that commands write into; files elsewhere in the bundle belong to the user."""
WAY_OUT = "choose another folder with --out (an earlier bundle is intact)"
ROOMS, SOURCES = ("design", "cad", "sims", "fabrication"), ("*.py", "*.toml", "*.npz", "*.j2")
"""Packages and kinds of files that the program consists of."""
RECORDED_PACKAGES = ("optopad", "numpy", "scipy", "numba", "mujoco", "cadquery", "trimesh", "manifold3d")


@dataclass(frozen=True)
class Part:
    """A part of a bundle, and what it is made from.

    Attributes
    ----------
    inputs : all that its files depend on, as plain data
    folders : beginnings of its files' paths, such as "cad/"
    """

    inputs: Mapping[str, Any]
    folders: tuple[str, ...]

    @property
    def digest(self) -> str:
        """The first 16 digits of the inputs' SHA-256, which name them in the manifest."""
        return hashlib.sha256(json.dumps(self.inputs, sort_keys=True).encode()).hexdigest()[:16]


def bundle_name(design: SensorDesign) -> str:
    """Folder name of a design's bundle: its name and the first 8 digits of its digest."""
    return f"{design.name}-{design.digest[:8]}"


_UNDER_WAY: set[Path] = set()
"""Hidden working folders that this process is using; each replaces a bundle when its command succeeds."""


@contextmanager
def bundle(design: SensorDesign, out: Path, *, seed: int, parts: Sequence[Part] = ()) -> Iterator[Path]:
    """Yield a folder to write into, which becomes the design's bundle if the `with` block succeeds.

    Parameters
    ----------
    out : folder that contains the bundles; created if missing
    seed : seed of the random numbers, recorded in the manifest
    parts : the parts that the block makes, with their inputs; for files of none, the whole design and the seed count

    Raises
    ------
    OutputError : the folder cannot be written, the disk is full, or a link is in the way. The previous bundle is
        intact.
    """
    final = out / bundle_name(design)
    staging = final.parent / f".{final.name}.{secrets.token_hex(4)}.partial"
    lock: int | None = None
    _UNDER_WAY.add(staging)
    try:
        try:
            final.parent.mkdir(parents=True, exist_ok=True)
            with alone_in(final.parent):
                _fill(staging, final)
                lock = locked(staging)
        except OSError as err:
            raise unwritable(final, err, WAY_OUT) from err
        begun_with, times = _digests(staging), _times(staging)
        yield staging
        save_design(design, staging / "design.toml")
        with alone_in(final.parent):
            fetched = _fetch(staging, final, begun_with)
            new = {name for name, time in _times(staging).items() if times.get(name) != time} - fetched
            write_manifest(staging, design, seed, parts, new)
            _flush(staging)
            _swap(staging, final)
    except OSError as err:
        if _is_elsewhere(err, out):
            raise
        raise unwritable(final, err, WAY_OUT) from err
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if lock is not None:
            os.close(lock)
        _UNDER_WAY.discard(staging)


def abandon() -> None:
    """Remove this process's unfinished output folders before it exits immediately; finished bundles remain."""
    for staging in tuple(_UNDER_WAY):
        shutil.rmtree(staging, ignore_errors=True)


def write_manifest(
    folder: Path, design: SensorDesign, seed: int, parts: Sequence[Part], new: Collection[str]
) -> None:
    """Write ``manifest.json``: digest, versions, seed, and every file with its size, SHA-256 and inputs.

    Several commands may fill one bundle. The list ``runs`` has the seed and versions of each, and the entry of a file
    contains the index of the run that wrote the file. ``seed`` and ``versions`` are those of the last run. The entry
    ``made_from`` of a file names one of ``inputs``, which lists what the file depends on, and all files made from it.

    Parameters
    ----------
    parts : the parts that the command made
    new : names of the files that the command wrote
    """
    rest = Part({"design": design.digest, "seed": seed, "program": program_digest()}, ("",))
    this_run = {"seed": seed, "versions": versions()}
    former = _former_manifest(folder)
    runs = [run for run in former["runs"] if run != this_run] + [this_run]
    files: dict[str, dict[str, Any]] = {}
    names: dict[str, list[str]] = {}
    for name in _files(folder):
        record, known = _record(folder / name), former["files"].get(name, {})
        same = known.get("sha256") == record["sha256"]
        made_by = former["runs"][known["run"]] if same else this_run
        made_from = known.get("made_from") if same else None
        part = next(one for one in (*parts, rest) if name.startswith(one.folders))
        if name in new and (part is not rest or not same):
            made_from = part.digest
            names.setdefault(part.digest, []).append(name)
        files[name] = {**record, "run": runs.index(made_by), "made_from": made_from}
    made = {
        part.digest: {**part.inputs, "files": names[part.digest]}
        for part in (*parts, rest)
        if part.digest in names
    }
    used = {record["made_from"] for record in files.values()}
    inputs = {digest: one for digest, one in (former["inputs"] | made).items() if digest in used}
    document = {
        "name": design.name, "digest": design.digest, **this_run, "runs": runs, "inputs": inputs, "files": files
    }  # fmt: skip
    write_text_atomically(folder / MANIFEST, json.dumps(document, indent=2, sort_keys=True) + "\n")


def current_files(folder: Path, part: Part) -> list[str]:
    """Names of the files of a bundle's part, if it was made from the same inputs and all are as they were made."""
    manifest, there = _former_manifest(folder), set(_files(folder))
    names: list[str] = manifest["inputs"].get(part.digest, {}).get("files", [])
    is_whole = all(
        name in there
        and manifest["files"].get(name, {}).get("made_from") == part.digest
        and _record(folder / name)["sha256"] == manifest["files"][name]["sha256"]
        for name in names
    )
    return names if is_whole else []


def copy_part(part: Part, folder: Path, out: Path, name: str) -> list[str]:
    """Copy a part into `folder` from another bundle of the same name in `out`; returns the files, if any."""
    for other in sorted(out.glob(f"{glob.escape(name)}-????????")):
        if files := current_files(other, part):
            for file in files:
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(other / file, folder / file)
            return files
    return []


@cache
def program_digest() -> str:
    """The first 16 digits of the SHA-256 of this program: its sources and data, and the packages it depends on."""
    digest = hashlib.sha256(json.dumps(versions()).encode())
    package = Path(__file__).parents[1]
    for folder in (package, *(package / room for room in ROOMS)):  # in a checkout the rooms are links
        for path in sorted(found for kind in SOURCES for found in folder.rglob(kind)):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def altered_files(folder: Path) -> tuple[str, ...]:
    """Paths, relative to the bundle, of files that are missing or whose digest differs from the manifest's.

    Raises
    ------
    InputError : the manifest is missing or damaged.
    """
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        recorded = {name: record["sha256"] for name, record in manifest["files"].items()}
    except OSError as err:
        raise InputError(f"{folder}: no bundle: {MANIFEST}: {err.strerror}; name a bundle's folder") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(
            f"{folder / MANIFEST}: damaged; run the command that made the bundle again"
        ) from None
    return tuple(
        name
        for name, digest in recorded.items()
        if not (folder / name).is_file() or _record(folder / name)["sha256"] != digest
    )


def with_other_line_ends(folder: Path, altered: Iterable[str]) -> tuple[str, ...]:
    """The altered files of a bundle that differ from the manifest's only in the ends of their lines.

    Git (`core.autocrlf`) and some copies by Windows change the ends of lines in texts.
    """
    files = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["files"]
    return tuple(
        name
        for name in altered
        if (folder / name).is_file() and files[name]["sha256"] in _digests_by_line_ends(folder / name)
    )


def _digests_by_line_ends(file: Path) -> set[str]:
    unix = file.read_bytes().replace(b"\r\n", b"\n")
    return {hashlib.sha256(text).hexdigest() for text in (unix, unix.replace(b"\n", b"\r\n"))}


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    found = {"python": platform.python_version()}
    for package in RECORDED_PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def _fill(staging: Path, final: Path) -> None:
    former = _former(final)
    if former.exists() and not os.path.lexists(final):
        former.rename(final)  # a swap was interrupted
    _sweep(final)
    _require_no_link(final)
    if final.exists():
        shutil.copytree(final, staging, symlinks=True)
    else:
        staging.mkdir()


def _require_no_link(final: Path) -> None:
    """Raise an error if the bundle contains symbolic links, because files would be written to the links' targets."""
    if final.is_symlink():
        raise OutputError(
            f"{final}: is a link, and a bundle is a folder; remove the link, or give the folder that holds the bundle "
            "with --out"
        )
    inside = [final / name for name in FOLDERS]
    for path in (*inside, *(path for folder in inside for path in folder.rglob("*"))):
        if path.is_symlink() and (path.is_dir() or path in inside):
            raise OutputError(
                f"{path}: is a link, and a bundle holds its files itself; replace the link by the folder that it leads "
                "to, or remove it"
            )


def _digests(folder: Path) -> dict[str, str]:
    return {name: _record(folder / name)["sha256"] for name in _files(folder)}


def _times(folder: Path) -> dict[str, int]:
    return {name: (folder / name).stat().st_mtime_ns for name in _files(folder)}


def _fetch(staging: Path, final: Path, begun_with: dict[str, str]) -> set[str]:
    """Copy into `staging` the files that other commands changed in the bundle since this command began.

    Returns the names of these files.

    `begun_with` contains the digests of the bundle's files when this command began. A file that this command has also
    written is not replaced.
    """
    _require_no_link(final)
    now = _digests(final)
    if now == begun_with or not final.exists():
        return set()
    own, fetched = _digests(staging), set()
    for name in now.keys() | begun_with.keys():
        if now.get(name) == begun_with.get(name) or own.get(name) != begun_with.get(name):
            continue  # the others did not change it, or this command also wrote it
        here = staging / name
        fetched.add(name)
        here.unlink(missing_ok=True)
        if name in now:
            here.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(final / name, here, follow_symlinks=False)
    if (final / MANIFEST).is_file():
        shutil.copy2(final / MANIFEST, staging / MANIFEST)  # it names the runs of the fetched files
    return fetched


def _flush(folder: Path) -> None:
    """Flush every file and folder to the disk, so that a power cut cannot leave a bundle of empty files."""
    for path in (*folder.rglob("*"), folder):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            continue
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _swap(staging: Path, final: Path) -> None:
    former = _former(final)
    _remove(former)
    try:
        if final.exists():
            final.rename(former)
        staging.rename(final)
    except BaseException:  # an interrupt between the two renames as well
        if former.exists() and not final.exists():
            former.rename(final)
        raise
    _remove(former)


def _former(final: Path) -> Path:
    return final.parent / f".{final.name}.old"


def _remove(folder: Path) -> None:
    """Remove a folder and its contents, or a symbolic link but not its target."""
    if folder.is_symlink():
        folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)


def _sweep(final: Path) -> None:
    """Remove hidden working folders that interrupted commands have left behind and that no process has locked."""
    pattern = re.compile(re.escape(f".{final.name}.") + r"[0-9a-f]+\.partial")
    for left in final.parent.iterdir():
        if pattern.fullmatch(left.name) and (lock := locked(left)) is not None:
            shutil.rmtree(left, ignore_errors=True)
            os.close(lock)


def _files(folder: Path) -> list[str]:
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(name for name in found if name != MANIFEST)


def _record(file: Path) -> dict[str, Any]:
    with file.open("rb") as stream:
        return {"sha256": hashlib.file_digest(stream, "sha256").hexdigest(), "bytes": stream.tell()}


def _former_manifest(folder: Path) -> dict[str, Any]:
    """Runs, inputs and files listed in the previous manifest; all are empty if it is missing or damaged."""
    nothing: dict[str, Any] = {"runs": [], "inputs": {}, "files": {}}
    try:
        document = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        runs, files = list(document["runs"]), dict(document["files"])
        inputs = {
            name: {**one, "files": [str(file) for file in one["files"]]}
            for name, one in document["inputs"].items()
        }
        complete = all(record["run"] in range(len(runs)) for record in files.values())
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return nothing
    return {"runs": runs, "inputs": inputs, "files": files} if complete else nothing


def _is_elsewhere(err: OSError, out: Path) -> bool:
    """Whether an error concerns a file outside the folder that contains the bundles."""
    if not isinstance(err.filename, str):
        return False
    return not Path(err.filename).absolute().is_relative_to(out.absolute())
