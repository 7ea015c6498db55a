"""Converts solids to triangle meshes, writes these as STL and 3MF files, and draws shaded pictures of them.

All files of a part are written from one mesh, so that STL and 3MF cannot disagree. The faces of a solid are
triangulated one by one. Vertices that are equal in single precision, as in a binary STL, are joined. Triangles with two
equal corners (at the apex of a dome) are removed, which leaves no opening.

By default the height of chords is a fraction of their face's size, fine enough for printing. The optical surfaces,
which are round walls and concave lids, are meshed with chords of a given height instead.

Pictures are drawn without a display. The parallel projection is from above and from the south-west, so that the
cavity's origin corner is in front. Triangles are drawn into a depth buffer at twice the final size. Edges between faces
that meet at an angle are drawn over them. Faces are shaded as if lit by two fixed lights. Parts that belong together,
such as a lid on its mold, are cut along x and shown without the southern half.
"""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import manifold3d
import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    import cadquery as cq

TOLERANCE_MM = 0.05
CHORD_MM = 0.003
"""Height of the chords of round walls and concave lids, a twentieth of a typical printing error."""
CHORD_LIMIT_MM = 0.005
"""Largest chord height that the kernel's mesher actually produces for `CHORD_MM`, including rounding."""
ANGULAR_TOLERANCE_RAD = 0.1
"""Largest angle between neighbouring chords of a circle."""

_STL_HEADER = b"optopad, binary STL, millimetres".ljust(80)
_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """A closed surface of triangles.

    Attributes
    ----------
    vertices : positions, shape (n, 3), single precision [mm]
    triangles : vertex indices, shape (m, 3), counter-clockwise as seen from outside
    """

    vertices: NDArray[np.float32]
    triangles: IntArray

    @property
    def corners(self) -> FloatArray:
        """Corner positions [mm], shape (m, 3, 3); the axes are triangle, corner and coordinate."""
        corners: FloatArray = self.vertices.astype(np.float64)[self.triangles]
        return corners


def mesh_of(part: cq.Workplane, lift_mm: float = 0.0, *, chord_mm: float | None = None) -> Mesh:
    """Mesh of a solid, raised by `lift_mm`.

    Parameters
    ----------
    chord_mm : largest height of the chords [mm]; if None, a fraction of each face's size
    """
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
    """Triangulate a solid with chords of an absolute height; those of cadquery are relative to each face's size."""
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    shape = part.val().wrapped  # type: ignore[union-attr]
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, chord_mm, False, ANGULAR_TOLERANCE_RAD)


def read_stl(content: bytes) -> Mesh:
    """The mesh in a binary STL file's content, with equal vertices joined."""
    (count,) = struct.unpack_from("<I", content, 80)
    rows = np.frombuffer(content, dtype=_STL_ROW, count=count, offset=84)
    vertices, index = np.unique(rows["corners"].reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices=vertices, triangles=index.reshape(-1, 3).astype(np.int64))


def stl_bytes(mesh: Mesh) -> bytes:
    """Content of a binary STL file; equal meshes give equal bytes."""
    rows = np.zeros(len(mesh.triangles), dtype=_STL_ROW)
    rows["corners"] = mesh.vertices[mesh.triangles]
    rows["normal"] = unit_normals(mesh)
    return _STL_HEADER + struct.pack("<I", len(rows)) + rows.tobytes()


def unit_normals(mesh: Mesh) -> FloatArray:
    """Outward unit normal of each triangle, shape (m, 3); zero for a triangle without area."""
    corners = mesh.corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: FloatArray = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return unit


def threemf_bytes(mesh: Mesh, title: str) -> bytes:
    """Content of a 3MF file with one object in millimetres; equal meshes and titles give equal bytes."""
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


Floats = FloatArray

AZIMUTH_DEG, ELEVATION_DEG = 245.0, 42.0
CUT_ELEVATION_DEG = 16.0
"""Elevation of the viewer for cut parts [deg]; it is low, so that the cut faces are visible."""
OVERSAMPLING = 2
MARGIN = 0.04
CREASE_DEG = 25.0
BODY_RGB = (0.56, 0.62, 0.70)
EDGE_RGB = (0.13, 0.16, 0.21)
LIGHTS = (((0.35, 0.25, 0.90), 0.62), ((-0.80, 0.45, 0.40), 0.30))
"""Direction of each light in the viewer's coordinate system (right, up, towards the viewer), and its strength."""
AMBIENT = 0.22


def mold_picture(
    part: Mesh | str | os.PathLike[str],
    *,
    width_px: int = 900,
    height_px: int = 640,
    elevation_deg: float = ELEVATION_DEG,
) -> bytes:
    """Shaded picture of a part as a PNG on a transparent background.

    Parameters
    ----------
    part : a mesh, or the path of a binary STL
    elevation_deg : angle of the viewer above the horizon
    """
    mesh = part if isinstance(part, Mesh) else read_stl(Path(part).read_bytes())
    size = (height_px * OVERSAMPLING, width_px * OVERSAMPLING)
    turn = _turn(elevation_deg)
    points = _fitted(mesh.vertices.astype(np.float64) @ turn.T, size)
    normals = unit_normals(mesh) @ turn.T
    image, depth = _shaded(points[mesh.triangles], normals, size)
    _draw_edges(image, depth, points, creases(mesh))
    return png_bytes(_reduced(image))


def section_picture(
    parts: Sequence[Mesh], y_mm: float, *, width_px: int = 900, height_px: int = 640
) -> bytes:
    """Shaded PNG of parts in a common coordinate system, cut at y = `y_mm` and shown without the half at lower y."""
    halves = [northern_half(part, y_mm) for part in parts]
    starts = np.cumsum([0, *(len(half.vertices) for half in halves)])
    whole = Mesh(
        vertices=np.concatenate([half.vertices for half in halves]),
        triangles=np.concatenate(
            [half.triangles + start for half, start in zip(halves, starts, strict=False)]
        ),
    )
    return mold_picture(whole, width_px=width_px, height_px=height_px, elevation_deg=CUT_ELEVATION_DEG)


def northern_half(mesh: Mesh, y_mm: float) -> Mesh:
    """The half of a closed mesh at y above `y_mm`, with the cut closed."""
    triangles = np.asarray(mesh.triangles, dtype=np.uint32)
    whole = manifold3d.Manifold(manifold3d.Mesh(mesh.vertices, triangles))
    half = whole.trim_by_plane((0.0, 1.0, 0.0), y_mm).to_mesh()
    vertices = np.asarray(half.vert_properties, dtype=np.float32)[:, :3]
    return Mesh(vertices=vertices, triangles=np.asarray(half.tri_verts, dtype=np.int64))


def _turn(elevation_deg: float) -> Floats:
    """Rotation matrix into the viewer's coordinate system: right, up, towards the viewer."""
    a, e = np.radians(AZIMUTH_DEG), np.radians(elevation_deg)
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def _fitted(points: Floats, size: tuple[int, int]) -> Floats:
    """Scale points in the viewer's coordinate system to the picture: column, row and depth in pixels.

    Depth increases towards the viewer.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.array([size[1], size[0]]) * (1 - 2 * MARGIN)
    scale = float((room / (high - low)[:2]).min())
    middle = (low + high) / 2
    flipped = (points - middle) * scale * np.array([1.0, -1.0, 1.0])
    fitted: Floats = flipped + np.array([size[1] / 2, size[0] / 2, 0.0])
    return fitted


def _shaded(corners: Floats, normals: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Draw all faces that point towards the viewer; return the image (rows, columns, rgba) and the depth buffer."""
    image, depth = np.zeros((*size, 4)), np.full(size, -np.inf)
    light = AMBIENT + sum(
        strength * np.clip(normals @ (np.array(way) / np.linalg.norm(way)), 0.0, 1.0)
        for way, strength in LIGHTS
    )
    colours = np.clip(light[:, None] * np.array(BODY_RGB) * 1.35, 0.0, 1.0)
    for k in np.flatnonzero(normals[:, 2] > 0):
        _fill(image, depth, corners[k], normals[k], colours[k])
    return image, depth


def _fill(image: Floats, depth: Floats, corners: Floats, normal: Floats, colour: Floats) -> None:
    """Draw a triangle into the image wherever it is nearer to the viewer than the depth buffer."""
    low = np.maximum(np.floor(corners[:, :2].min(axis=0)).astype(int), 0)
    high = np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1
    x, y = np.arange(low[0], high[0]) + 0.5, (np.arange(low[1], high[1]) + 0.5)[:, None]
    inside = np.ones((len(y), len(x)), dtype=bool)
    for (xa, ya, _), (xb, yb, _) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (xb - xa) * (y - ya) - (yb - ya) * (x - xa) <= 0.0
    rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
    x0, y0, z0 = corners[0]
    plane = z0 - (normal[0] * (x - x0) - normal[1] * (y - y0)) / normal[2]
    inside &= plane > depth[rows, columns]
    depth[rows, columns][inside] = plane[inside]
    image[rows, columns][inside] = (*colour, 1.0)


def creases(mesh: Mesh) -> IntArray:
    """Vertex indices of the edges at which two faces meet at more than `CREASE_DEG`, shape (n, 2)."""
    triangles, normals = mesh.triangles, unit_normals(mesh)
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1
    )
    face = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, face = edges[order], face[order]
    pairs = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    cosine = np.einsum("ij,ij->i", normals[face[pairs]], normals[face[pairs + 1]])
    sharp: IntArray = edges[pairs[cosine < np.cos(np.radians(CREASE_DEG))]]
    return sharp


def _draw_edges(image: Floats, depth: Floats, points: Floats, edges: IntArray) -> None:
    """Draw lines two pixels wide wherever they are not behind the faces drawn so far."""
    for a, b in points[edges]:
        steps = int(np.abs(b - a)[:2].max()) + 2
        line = a + np.linspace(0.0, 1.0, steps)[:, None] * (b - a)
        for shift in ((0, 0), (1, 0), (0, 1)):
            columns, rows = (line[:, :2] + shift).astype(int).T
            seen = line[:, 2] >= depth[rows, columns] - 3.0
            image[rows[seen], columns[seen]] = (*EDGE_RGB, 1.0)


def _reduced(image: Floats) -> NDArray[np.uint8]:
    """Reduce an image by averaging blocks of pixels, with colour weighted by opacity."""
    rows, columns = image.shape[0] // OVERSAMPLING, image.shape[1] // OVERSAMPLING
    blocks = image.reshape(rows, OVERSAMPLING, columns, OVERSAMPLING, 4).mean(axis=(1, 3))
    alpha = blocks[..., 3:]
    colour = np.divide(blocks[..., :3], alpha, out=np.zeros_like(blocks[..., :3]), where=alpha > 0)
    pixels: NDArray[np.uint8] = np.rint(np.concatenate([colour, alpha], axis=2) * 255).astype(np.uint8)
    return pixels


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """Content of a PNG file with RGBA pixels of shape (rows, columns, 4)."""
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    packed = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)
