"""The packages that are written into a ROS 2 workspace."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from optopad import __version__
from optopad.cli import main
from optopad.fabrication.ros2 import __main__ as driver_alone
from optopad.fabrication.ros2 import definition, names

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def src(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ws") / "src"
    assert main(["driver", "ros2", "--out", str(folder)]) == 0
    return folder


def test_the_driver_alone_writes_the_same_packages(
    src: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert driver_alone.main([str(tmp_path)]) == 0
    there = [{one.relative_to(folder) for one in folder.rglob("*")} for folder in (tmp_path, src)]
    assert there[0] == there[1]
    assert driver_alone.main([str(tmp_path)]) == 2
    assert "optopad_msgs exists already" in capsys.readouterr().err
    assert driver_alone.main([]) == 2


def test_the_packages_are_whole(src: Path) -> None:
    assert sorted(one.name for one in src.iterdir()) == ["optopad_msgs", "optopad_ros"]
    for package in src.iterdir():
        manifest = ElementTree.parse(package / "package.xml").getroot()
        assert (manifest.findtext("name"), manifest.findtext("license")) == (package.name, "MIT")
        assert not list(package.rglob("__pycache__"))
        assert manifest.findtext("version") == __version__
    listed = re.findall(r'"((?:msg|srv)/\w+\.\w+)"', (src / "optopad_msgs" / "CMakeLists.txt").read_text())
    there = [one.relative_to(src / "optopad_msgs").as_posix() for one in (src / "optopad_msgs").glob("*/*")]
    assert sorted(listed) == sorted(there)
    assert {f"optopad_msgs/msg/{Path(one).stem}" for one in listed if one.startswith("msg")} == set(names())
    for name in names():  # a contact is within a touch, whose header it has
        assert ("MSG: std_msgs/Header" in definition(name)) == (not name.endswith("/Contact"))
    assert "MSG: optopad_msgs/Contact\n# One of the touches" in definition("optopad_msgs/msg/Touch")


def test_every_import_of_the_node_is_a_dependency(src: Path) -> None:
    manifest = ElementTree.parse(src / "optopad_ros" / "package.xml").getroot()
    declared = {one.text for tag in ("depend", "exec_depend") for one in manifest.iter(tag)}
    used = set()
    for file in (src / "optopad_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                used |= {one.name.split(".")[0] for one in node.names}
            elif isinstance(node, ast.ImportFrom):
                used.add(str(node.module).split(".")[0])
    outside = {"optopad", "setuptools"} | set(sys.stdlib_module_names)
    assert used - outside == declared


def test_nothing_is_replaced(src: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (src / "optopad_ros" / "own.txt").write_text("mine")
    assert main(["driver", "ros2", "--out", str(src)]) == 2
    assert "optopad_msgs" in capsys.readouterr().err
    assert (src / "optopad_ros" / "own.txt").read_text() == "mine"
