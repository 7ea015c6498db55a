"""Writes optopad's ROS 2 packages into a workspace."""

from __future__ import annotations

import shutil
from importlib.resources import as_file, files
from pathlib import Path

from optopad.design.errors import InputError
from optopad.design.files import whole_folder

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
    for package in made:
        with (
            whole_folder(package) as hidden,
            as_file(files("optopad.fabrication.ros2") / package.name) as source,
        ):
            shutil.copytree(source, hidden, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    return made
