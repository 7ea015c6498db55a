"""A shaded picture of a printed part, drawn without a display.

Parallel projection seen from above and the south-west, so that the origin corner is in front. Triangles go into
a depth buffer at twice the final size; edges between faces that meet at an angle are drawn over it.
Shading is a cosine to two fixed lights: a picture to recognise the part by, no measurement.

Parts that belong together are shown cut along x, their south half taken away: a lid on its mold.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import manifold3d
import numpy as np
from numpy.typing import NDArray

from cad.mesh import Mesh, read_stl, unit_normals
from design.arrays import FloatArray, IntArray

Floats = FloatArray

AZIMUTH_DEG, ELEVATION_DEG = 245.0, 42.0
CUT_ELEVATION_DEG = 16.0
"""Lower, so that the cut faces are seen."""
OVERSAMPLING = 2
MARGIN = 0.04
CREASE_DEG = 25.0
BODY_RGB = (0.56, 0.62, 0.70)
EDGE_RGB = (0.13, 0.16, 0.21)
LIGHTS = (((0.35, 0.25, 0.90), 0.62), ((-0.80, 0.45, 0.40), 0.30))
"""Directions in the viewer's frame (right, up, towards the viewer) and strengths."""
AMBIENT = 0.22


def mold_picture(
    part: Mesh | str | os.PathLike[str],
    *,
    width_px: int = 900,
    height_px: int = 640,
    elevation_deg: float = ELEVATION_DEG,
) -> bytes:
    """PNG of a part, on a transparent ground.

    Parameters
    ----------
    part : a mesh, or the path of a binary STL
    elevation_deg : how far above the horizon the viewer is
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
    """PNG of the northern halves of parts in one frame, cut at a level y."""
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
    """What of a closed mesh lies north of a level y, closed again."""
    triangles = np.asarray(mesh.triangles, dtype=np.uint32)
    whole = manifold3d.Manifold(manifold3d.Mesh(mesh.vertices, triangles))
    half = whole.trim_by_plane((0.0, 1.0, 0.0), y_mm).to_mesh()
    vertices = np.asarray(half.vert_properties, dtype=np.float32)[:, :3]
    return Mesh(vertices=vertices, triangles=np.asarray(half.tri_verts, dtype=np.int64))


def _turn(elevation_deg: float) -> Floats:
    """Rotation to the viewer's frame: right, up, towards the viewer."""
    a, e = np.radians(AZIMUTH_DEG), np.radians(elevation_deg)
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def _fitted(points: Floats, size: tuple[int, int]) -> Floats:
    """Column, row and depth in pixels; depth grows towards the viewer."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.array([size[1], size[0]]) * (1 - 2 * MARGIN)
    scale = float((room / (high - low)[:2]).min())
    middle = (low + high) / 2
    flipped = (points - middle) * scale * np.array([1.0, -1.0, 1.0])
    fitted: Floats = flipped + np.array([size[1] / 2, size[0] / 2, 0.0])
    return fitted


def _shaded(corners: Floats, normals: Floats, size: tuple[int, int]) -> tuple[Floats, Floats]:
    """Image (rows, columns, rgba) and depth buffer of all faces towards the viewer."""
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
    """One triangle: pixels inside of its three edges and nearer than what is there."""
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
    """(n, 2) vertices of the edges where two faces meet at more than `CREASE_DEG`."""
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
    """Lines two pixels wide where they are not behind the faces drawn so far."""
    for a, b in points[edges]:
        steps = int(np.abs(b - a)[:2].max()) + 2
        line = a + np.linspace(0.0, 1.0, steps)[:, None] * (b - a)
        for shift in ((0, 0), (1, 0), (0, 1)):
            columns, rows = (line[:, :2] + shift).astype(int).T
            seen = line[:, 2] >= depth[rows, columns] - 3.0
            image[rows[seen], columns[seen]] = (*EDGE_RGB, 1.0)


def _reduced(image: Floats) -> NDArray[np.uint8]:
    """Mean over blocks of pixels, with colour weighted by opacity."""
    rows, columns = image.shape[0] // OVERSAMPLING, image.shape[1] // OVERSAMPLING
    blocks = image.reshape(rows, OVERSAMPLING, columns, OVERSAMPLING, 4).mean(axis=(1, 3))
    alpha = blocks[..., 3:]
    colour = np.divide(blocks[..., :3], alpha, out=np.zeros_like(blocks[..., :3]), where=alpha > 0)
    pixels: NDArray[np.uint8] = np.rint(np.concatenate([colour, alpha], axis=2) * 255).astype(np.uint8)
    return pixels


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """RGBA pixels as a PNG file."""
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    packed = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)
