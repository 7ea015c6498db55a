"""Writes a pad as MJCF: `pad.xml` to attach to a robot, `demo.xml`, and their meshes as STL in millimetres."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco

from optopad.cad.mesh import stl_bytes
from optopad.design.file_sets import written_together
from optopad.design.spec import SensorDesign
from optopad.fabrication.scene.demo import demo_spec
from optopad.fabrication.scene.mjcf import M_PER_MM, pad_meshes, pad_spec

NOTE = """<!-- The pad {name} ({digest}), in m, kg and s. Attach it to a robot's model:
       in Python  robot.attach(mujoco.MjSpec.from_file("pad.xml"), prefix="left_", site=finger_site)
       in MJCF    <asset><model name="pad" file="pad.xml"/></asset> and <attach model="pad" body="pad" prefix="left_"/>
     Then call optopad.fabrication.scene.contact_fit.tuned(model, "left"), or optopad.SimulatedPad does; without it the
     pad is hard. Use option cone="elliptic" impratio="100", so that held objects do not creep. -->
"""


def scene_files(design: SensorDesign) -> dict[str, bytes]:
    """Content of every file by name; errors are those of `mjcf.pad_spec`."""
    meshes = {f"{name}.stl": stl_bytes(mesh) for name, mesh in pad_meshes(design).items()}
    note = NOTE.format(name=design.name, digest=design.digest[:8])
    texts = {
        "pad.xml": note + _with_files(pad_spec(design), meshes),
        "demo.xml": _with_files(demo_spec(design), meshes),
    }
    return meshes | {name: text.encode() for name, text in texts.items()}


def write_scene(design: SensorDesign, folder: str | os.PathLike[str]) -> dict[str, Path]:
    """Write the files into a folder, all of them or none; returns the path of each by name."""
    contents, target = scene_files(design), Path(folder)
    with written_together(target) as hidden:
        for name, content in contents.items():
            (hidden / name).write_bytes(content)
    return {name: target / name for name in contents}


def _with_files(spec: mujoco.MjSpec, files: dict[str, bytes]) -> str:
    """MJCF of a model whose visual meshes are files in place of numbers."""
    for mesh in spec.meshes:
        name = next((one for one in files if mesh.name.endswith(one.removesuffix(".stl"))), None)
        if name is not None:
            mesh.uservert, mesh.userface = [], []
            mesh.file, mesh.scale = name, [M_PER_MM] * 3
    spec.assets = files
    spec.compile()
    return str(spec.to_xml())
