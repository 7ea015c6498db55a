"""Writes optopad's ROS 2 packages into a workspace."""

from __future__ import annotations

import shutil
from importlib.resources import as_file, files
from pathlib import Path

from design.errors import InputError, OutputError
from design.files import folder_fault

PACKAGES = ("optopad_msgs", "optopad_ros")


def write_packages(folder: Path) -> list[Path]:
    """Write the packages into a folder, usually the ``src`` of a workspace.

    Returns
    -------
    the folders of the packages

    Raises
    ------
    InputError : a folder of a package's name exists already.
    OutputError : the folder cannot be written.
    """
    made = [folder / name for name in PACKAGES]
    for package in made:
        if package.exists():
            raise InputError(
                f"--out {folder}: {package.name} exists already; remove it, or choose another folder"
            )
    if fault := folder_fault(folder):
        raise OutputError(f"--out {folder}: cannot be written: {fault}; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    for package in made:
        hidden = folder / f".{package.name}.new"
        shutil.rmtree(hidden, ignore_errors=True)
        with as_file(files("fabrication.ros2") / package.name) as source:
            shutil.copytree(source, hidden, ignore=shutil.ignore_patterns("__pycache__"))
        hidden.rename(package)
    return made
