"""Solids as triangles: one mesh for every file, so that STL and 3MF cannot disagree.

Faces of a solid are triangulated one by one; their vertices are joined where they are equal as
single-precision numbers, which is what a binary STL holds. Triangles with two equal corners (at the
pole of a dome) are dropped: nothing is left open by that.

By default chords keep to a share of their face's size, as a printer needs them. Round walls and dishes, which light
meets, are meshed with chords of a given height instead.
"""

from __future__ import annotations

import io
import struct
import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    import cadquery as cq

TOLERANCE_MM = 0.05
CHORD_MM = 0.003
"""Height of the chords of round walls and dishes: a twentieth of a print's usual error."""
CHORD_LIMIT_MM = 0.005
"""What the kernel's mesher makes of it at worst, and single precision."""
ANGULAR_TOLERANCE_RAD = 0.1
"""Chords of a circle turn by at most this: it sets the number of triangles."""

_STL_HEADER = b"optopad, binary STL, millimetres".ljust(80)
_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A closed surface.

    Attributes
    ----------
    vertices : (n, 3) positions, single precision [mm]
    triangles : (m, 3) vertex indices, counter-clockwise from outside
    """

    vertices: NDArray[np.float32]
    triangles: IntArray

    @property
    def corners(self) -> FloatArray:
        """(m, 3, 3) triangle, corner, coordinate [mm]."""
        corners: FloatArray = self.vertices.astype(np.float64)[self.triangles]
        return corners


def mesh_of(part: cq.Workplane, lift_mm: float = 0.0, *, chord_mm: float | None = None) -> Mesh:
    """Triangles of a solid, raised by `lift_mm`; with chords no higher than `chord_mm`, where it is given."""
    if chord_mm is not None:
        _mesh_finely(part, chord_mm)
    points, triples = part.val().tessellate(TOLERANCE_MM, ANGULAR_TOLERANCE_RAD)  # type: ignore[union-attr]
    loose = np.array([point.toTuple() for point in points], dtype=np.float64)
    loose[:, 2] += lift_mm
    vertices, index = np.unique(loose.astype(np.float32) + np.float32(0.0), axis=0, return_inverse=True)
    triangles = index.reshape(-1)[np.array(triples, dtype=np.int64)]
    a, b, c = triangles.T
    return Mesh(vertices=vertices, triangles=triangles[(a != b) & (b != c) & (c != a)])


def _mesh_finely(part: cq.Workplane, chord_mm: float) -> None:
    """Meshes a solid with chords of an absolute height, where cadquery's are relative to the size of each face."""
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    shape = part.val().wrapped  # type: ignore[union-attr]
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, chord_mm, False, ANGULAR_TOLERANCE_RAD)


def read_stl(content: bytes) -> Mesh:
    """The mesh of a binary STL, equal vertices joined."""
    (count,) = struct.unpack_from("<I", content, 80)
    rows = np.frombuffer(content, dtype=_STL_ROW, count=count, offset=84)
    vertices, index = np.unique(rows["corners"].reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices=vertices, triangles=index.reshape(-1, 3).astype(np.int64))


def stl_bytes(mesh: Mesh) -> bytes:
    """Binary STL; equal meshes give equal bytes."""
    rows = np.zeros(len(mesh.triangles), dtype=_STL_ROW)
    rows["corners"] = mesh.vertices[mesh.triangles]
    rows["normal"] = unit_normals(mesh)
    return _STL_HEADER + struct.pack("<I", len(rows)) + rows.tobytes()


def unit_normals(mesh: Mesh) -> FloatArray:
    """(m, 3) outward unit normals; zero for a triangle without area."""
    corners = mesh.corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: FloatArray = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return unit


def threemf_bytes(mesh: Mesh, title: str) -> bytes:
    """3MF package with one object in millimetres; equal meshes and titles give equal bytes."""
    members = {
        "[Content_Types].xml": '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
        '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>'
        "</Types>",
        "_rels/.rels": '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        '<Relationship Target="/3D/3dmodel.model" Id="model" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>',
        "3D/3dmodel.model": _model_xml(mesh, title),
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as package:
        for name, text in members.items():
            info = zipfile.ZipInfo(name, _ZIP_TIME)
            info.compress_type = zipfile.ZIP_DEFLATED
            package.writestr(info, f'<?xml version="1.0" encoding="UTF-8"?>\n{text}')
    return buffer.getvalue()


def _model_xml(mesh: Mesh, title: str) -> str:
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in mesh.vertices.tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.triangles.tolist())
    return (
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}"><resources>'
        f'<object id="1" name={quoteattr(title)} type="model"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
