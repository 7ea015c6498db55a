"""A plain mold to draw: outside and cavity of a design's mold as two boxes, made without a CAD kernel."""

from __future__ import annotations

import numpy as np

from optopad.cad.mesh import Mesh, stl_bytes
from optopad.design.mold.outline import bed_lift_mm, outline_of
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign


def shell_stl(design: SensorDesign) -> bytes:
    """A box with the mold's outside and its cavity as an inner box: closed, and quicker than the mold."""
    outline, cavity, lift = outline_of(design), cavity_of(design), bed_lift_mm(design)
    outer = np.array(
        [
            [-outline.wall_x_mm, -outline.wall_y_mm, outline.bottom_mm],
            [cavity.length_mm + outline.wall_x_mm, cavity.width_mm + outline.wall_y_mm, outline.top_mm],
        ]
    )
    inner = np.array(
        [[0.0, 0.0, -cavity.black_mm], [cavity.length_mm, cavity.width_mm, outline.top_mm - 0.5]]
    )
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    both = []
    for box, faces in ((outer, triangles), (inner, triangles[:, ::-1])):
        corners = np.array([[box[k & 1][0], box[k >> 1 & 1][1], box[k >> 2][2]] for k in range(8)])
        both.append((corners + np.array([0.0, 0.0, lift]), faces))
    vertices = np.concatenate([corners for corners, _ in both]).astype(np.float32)
    faces = np.concatenate([both[0][1], both[1][1] + 8])
    return stl_bytes(Mesh(vertices=vertices, triangles=faces))
