"""ROS 2: the messages of optopad, and the packages that `optopad driver ros2` writes into a workspace.

`optopad_msgs` and `optopad_ros` are data: they are copied into a workspace, and nothing here imports them. A message's
definition is complete with those of the messages that it contains.

Imports within this repository: optopad.design.errors, optopad.design.files.
"""

from __future__ import annotations

import re
import shutil
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

from optopad.design.errors import InputError
from optopad.design.files import whole_folder

PACKAGE = "optopad_msgs"
_FOLDER = files("optopad.fabrication.ros2") / PACKAGE / "msg"
_LINE = "=" * 80
_FIELD = re.compile(r"^(?P<type>[A-Za-z][\w/]*)(?:\[\d*\])?\s+\w", re.MULTILINE)

COMMON = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
"""Messages of ROS itself that optopad's contain; they are the same in Humble and Jazzy."""


def names() -> tuple[str, ...]:
    """Types of all messages, such as ``optopad_msgs/msg/Frame``."""
    return tuple(sorted(f"{PACKAGE}/msg/{one.name.removesuffix('.msg')}" for one in _FOLDER.iterdir()))


@cache
def definition(name: str) -> str:
    """The definition of a message, followed by those of all messages that it contains, as in MCAP files."""
    text = _own(name)
    parts, wanted, done = [text], _contained(text), set[str]()
    while wanted:
        one = wanted.pop(0)
        if one not in done:
            done.add(one)
            held = _own(one) if one.startswith(PACKAGE) else COMMON[one]
            parts.append(f"{_LINE}\nMSG: {one}\n{held}")
            wanted += _contained(held)
    return "".join(parts)


def _own(name: str) -> str:
    return (_FOLDER / f"{name.rpartition('/')[2]}.msg").read_text(encoding="utf-8")


def _contained(text: str) -> list[str]:
    return [found["type"] for found in _FIELD.finditer(text) if "/" in found["type"]]


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
