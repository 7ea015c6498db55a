"""The bundle: one folder a design, complete or absent, whatever interrupts the work.

Work happens in a hidden folder beside the bundle, filled with what the bundle already holds; at the
end the manifest is written and the folders change places. A bundle that was being replaced when the
machine stopped is put back by the next writer.

    outputs/<name>-<digest8>/                      the bundle
    outputs/.<name>-<digest8>.<process>.partial/   work in progress
    outputs/.<name>-<digest8>.old/                 the former bundle, for the moment of the change
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import Any

from design.errors import OutputError
from design.io import save_design, write_text_atomically
from design.spec import SensorDesign

MANIFEST = "manifest.json"
RECORDED_PACKAGES = ("optopad", "numpy", "scipy", "numba", "mujoco", "cadquery", "trimesh", "manifold3d")


def bundle_name(design: SensorDesign) -> str:
    """Folder name of a design's bundle: its name and the first 8 digits of its digest."""
    return f"{design.name}-{design.digest[:8]}"


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
    try:
        staging = _staging(final)
    except OSError as err:
        raise _unwritable(out, err) from err
    try:
        yield staging
        save_design(design, staging / "design.toml")
        write_manifest(staging, design, seed)
        _swap(staging, final)
    except OSError as err:
        raise _unwritable(final, err) from err
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def write_manifest(folder: Path, design: SensorDesign, seed: int) -> None:
    """Write ``manifest.json``: digest, versions, seed, and every file with its size and SHA-256."""
    document = {
        "name": design.name,
        "digest": design.digest,
        "seed": seed,
        "versions": versions(),
        "files": {name: _record(folder / name) for name in _files(folder)},
    }
    write_text_atomically(folder / MANIFEST, json.dumps(document, indent=2, sort_keys=True) + "\n")


def altered_files(folder: Path) -> tuple[str, ...]:
    """Names of files that are missing or differ from the bundle's manifest."""
    recorded = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["files"]
    return tuple(
        name
        for name, record in recorded.items()
        if not (folder / name).is_file() or _record(folder / name) != record
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


def _staging(final: Path) -> Path:
    final.parent.mkdir(parents=True, exist_ok=True)
    former = _former(final)
    if former.exists() and not final.exists():
        former.rename(final)  # a change of places was cut short
    _sweep(final)
    staging = final.parent / f".{final.name}.{os.getpid()}.partial"
    if final.exists():
        shutil.copytree(final, staging)
    else:
        staging.mkdir()
    return staging


def _swap(staging: Path, final: Path) -> None:
    former = _former(final)
    shutil.rmtree(former, ignore_errors=True)
    if final.exists():
        final.rename(former)
    try:
        staging.rename(final)
    except OSError:
        if former.exists() and not final.exists():
            former.rename(final)
        raise
    shutil.rmtree(former, ignore_errors=True)


def _former(final: Path) -> Path:
    return final.parent / f".{final.name}.old"


def _sweep(final: Path) -> None:
    """Remove work in progress whose process is gone."""
    for left in final.parent.glob(f".{final.name}.*.partial"):
        process = left.name.rsplit(".", 2)[-2]
        if process.isdigit() and not _is_running(int(process)):
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
    found = (path for path in folder.rglob("*") if path.is_file() and path.name != MANIFEST)
    return sorted(path.relative_to(folder).as_posix() for path in found)


def _record(file: Path) -> dict[str, Any]:
    content = file.read_bytes()
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def _unwritable(folder: Path, err: OSError) -> OutputError:
    return OutputError(
        f"{folder}: cannot be written: {err.strerror or err}; free the disk or choose another folder with --out "
        "(an earlier bundle is intact)"
    )
