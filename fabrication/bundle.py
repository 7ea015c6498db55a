"""The bundle: one folder a design, complete or absent, whatever interrupts the work.

Work happens in a hidden folder beside the bundle, filled with what the bundle already holds; at the
end the manifest is written and the folders change places. A bundle that was being replaced when the
machine stopped is put back by the next writer. Everything is on the disk before the folders change places.

Several commands may work on one bundle at a time. Each fetches what others have finished meanwhile before its folder
takes the place; of files that both wrote, the later one's stay. Copies and changes of places wait for one another.

    outputs/<name>-<digest8>/                      the bundle
    outputs/.<name>-<digest8>.<process>.partial/   work in progress
    outputs/.<name>-<digest8>.old/                 the former bundle, for the moment of the change
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import metadata
from pathlib import Path
from typing import Any

from design.errors import InputError, OutputError
from design.io import save_design, write_text_atomically
from design.spec import SensorDesign

MANIFEST = "manifest.json"
RECORDED_PACKAGES = ("optopad", "numpy", "scipy", "numba", "mujoco", "cadquery", "trimesh", "manifold3d")


def bundle_name(design: SensorDesign) -> str:
    """Folder name of a design's bundle: its name and the first 8 digits of its digest."""
    return f"{design.name}-{design.digest[:8]}"


_UNDER_WAY: set[Path] = set()
"""Hidden folders of the work in progress."""


@contextmanager
def bundle(design: SensorDesign, out: Path, *, seed: int) -> Iterator[Path]:
    """A folder to write into, which becomes the bundle when the block ends well.

    Parameters
    ----------
    out : folder that holds the bundles; made when missing
    seed : recorded in the manifest

    Raises
    ------
    OutputError : the folder cannot be written or the disk is full; the old bundle is intact.
    """
    final = out / bundle_name(design)
    staging = _staging_path(final)
    _UNDER_WAY.add(staging)
    try:
        try:
            final.parent.mkdir(parents=True, exist_ok=True)
            with _alone(final.parent):
                _fill(staging, final)
        except OSError as err:
            raise _unwritable(final, err) from err
        begun_with = _recorded(staging)
        yield staging
        save_design(design, staging / "design.toml")
        with _alone(final.parent):
            _fetch(staging, final, begun_with)
            write_manifest(staging, design, seed)
            _flush(staging)
            _swap(staging, final)
    except OSError as err:
        if _is_elsewhere(err, out):
            raise
        raise _unwritable(final, err) from err
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        _UNDER_WAY.discard(staging)


def abandon() -> None:
    """Remove the work in progress of a process that ends at once; what is in its place already stays."""
    for staging in tuple(_UNDER_WAY):
        shutil.rmtree(staging, ignore_errors=True)


def write_manifest(folder: Path, design: SensorDesign, seed: int) -> None:
    """Write ``manifest.json``: digest, versions, seed, and every file with its size and SHA-256.

    A bundle is filled by several commands. Each file names the run that made it, by its place in
    ``runs``; ``seed`` and ``versions`` are those of the last run.
    """
    this_run = {"seed": seed, "versions": versions()}
    former = _former_manifest(folder)
    runs = [run for run in former["runs"] if run != this_run] + [this_run]
    files = {}
    for name in _files(folder):
        record, known = _record(folder / name), former["files"].get(name, {})
        same = known.get("sha256") == record["sha256"]
        made_by = former["runs"][known["run"]] if same else this_run
        files[name] = {**record, "run": runs.index(made_by)}
    document = {"name": design.name, "digest": design.digest, **this_run, "runs": runs, "files": files}
    write_text_atomically(folder / MANIFEST, json.dumps(document, indent=2, sort_keys=True) + "\n")


def altered_files(folder: Path) -> tuple[str, ...]:
    """Names of files that are missing or differ from the bundle's manifest.

    Raises
    ------
    InputError : no manifest, or one that is damaged.
    """
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        recorded = {name: record["sha256"] for name, record in manifest["files"].items()}
    except OSError as err:
        raise InputError(f"{folder}: no bundle: {MANIFEST}: {err.strerror}; name a bundle's folder") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError(
            f"{folder / MANIFEST}: damaged; run the command that made the bundle again"
        ) from None
    return tuple(
        name
        for name, digest in recorded.items()
        if not (folder / name).is_file() or _record(folder / name)["sha256"] != digest
    )


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that made a result."""
    found = {"python": platform.python_version()}
    for package in RECORDED_PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "not installed"
    return found


def _staging_path(final: Path) -> Path:
    return final.parent / f".{final.name}.{os.getpid()}.partial"


def _fill(staging: Path, final: Path) -> None:
    """Make the folder of the work in progress, with what the bundle already holds."""
    former = _former(final)
    if former.exists() and not final.exists():
        former.rename(final)  # a change of places was cut short
    _sweep(final)
    if final.exists():
        shutil.copytree(final, staging, symlinks=True)
    else:
        staging.mkdir()


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Keep other commands from copying and changing bundles of a folder; for a moment, and as long as they live."""
    if os.name == "nt":  # which has no locks of folders
        yield
        return
    import fcntl

    descriptor = os.open(out, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _recorded(folder: Path) -> dict[str, str]:
    """SHA-256 of every file that the manifest names; nothing without a manifest."""
    return {name: str(record.get("sha256")) for name, record in _former_manifest(folder)["files"].items()}


def _fetch(staging: Path, final: Path, begun_with: dict[str, str]) -> None:
    """Take over what another command has put into the bundle since this one began, or taken out of it."""
    now = _recorded(final)
    if not now or now == begun_with:
        return
    for name in now.keys() | begun_with.keys():
        here = staging / name
        own = _record(here)["sha256"] if here.is_file() else None
        if now.get(name) == begun_with.get(name) or own != begun_with.get(name):
            continue  # the other left it alone, or this command wrote it, too
        if name not in now:
            here.unlink()
        elif (final / name).is_file():
            here.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(final / name, here)
    shutil.copy2(final / MANIFEST, staging / MANIFEST)  # it names the runs of what was taken over


def _flush(folder: Path) -> None:
    """Have every file and folder on the disk, so that a power cut cannot leave a bundle of empty files."""
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
    shutil.rmtree(former, ignore_errors=True)
    try:
        if final.exists():
            final.rename(former)
        staging.rename(final)
    except BaseException:  # an interrupt between the two renames as well
        if former.exists() and not final.exists():
            former.rename(final)
        raise
    shutil.rmtree(former, ignore_errors=True)


def _former(final: Path) -> Path:
    return final.parent / f".{final.name}.old"


def _sweep(final: Path) -> None:
    """Remove work in progress whose process is gone."""
    pattern = re.compile(re.escape(f".{final.name}.") + r"([0-9]+)\.partial")
    for left in final.parent.iterdir():
        named = pattern.fullmatch(left.name)
        if named and not _is_running(int(named[1])):
            shutil.rmtree(left, ignore_errors=True)


def _is_running(process: int) -> bool:
    if process == os.getpid():
        return False  # our own earlier attempt in this process
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _files(folder: Path) -> list[str]:
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(name for name in found if name != MANIFEST)


def _record(file: Path) -> dict[str, Any]:
    content = file.read_bytes()
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def _former_manifest(folder: Path) -> dict[str, Any]:
    """Runs and files of the manifest that is being replaced; none when there is none or it is damaged."""
    nothing: dict[str, Any] = {"runs": [], "files": {}}
    try:
        document = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        runs, files = list(document["runs"]), dict(document["files"])
        complete = all(record["run"] in range(len(runs)) for record in files.values())
    except (OSError, ValueError, KeyError, TypeError):
        return nothing
    return {"runs": runs, "files": files} if complete else nothing


def _is_elsewhere(err: OSError, out: Path) -> bool:
    """Whether an error names a file outside the bundles' folder: then it is not about writing here."""
    if not isinstance(err.filename, str):
        return False
    return not Path(err.filename).absolute().is_relative_to(out.absolute())


def _unwritable(folder: Path, err: OSError) -> OutputError:
    reason = err.strerror or str(err)
    return OutputError(
        f"{folder}: cannot be written: {reason}; free the disk or choose another folder with --out "
        "(an earlier bundle is intact)"
    )
