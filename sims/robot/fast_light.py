r"""The light of a pad under any objects, in a tenth of a millisecond: a map that is fitted to traced states.

    light over untouched light = Π_i b_i + V · (F(o) - Σ_i F(o_i))                                  pair by pair

b_i is the light under the design's tip where ball i touches, and as deep, from a spline through traced presses
(`optopad.sims.learning.traced_map`), for balls like the tip. So these read what `optopad simulate` computes. o is the
overlap of all objects with the untouched top at the nodes of a grid (`shapes`), o_i that of the tip in place of ball i.
Without such balls, the product is 1 and the sum is 0. F has `CHANNELS` numbers for each cell of a grid of 2 x 2 nodes,
and V weighs them for each pair.

Light that the top mirrors once is a sum over the points of the top: each adds what it mirrors, which depends on its
slope and ends where an object touches. So V F is a sum over the cells. To solve the deformed top itself would take much
longer. Its place is taken by the fields

    t = (mean of max(o, 0)⁴ over a Gaussian neighbourhood)^(1/4)

of two widths: t is about the depth in the contact, however narrow that is, and falls off around it as the dimple does.
With the gradient g of t, F has, the first two as means over a cell's nodes, the others at its middle,

    1 / (1 + exp(-o / 0.05 mm)),   √max(o, 0),   t of the narrower neighbourhood,   and of each neighbourhood
    |g|², gx² - gy², gx gy, each over c² + |g|²,   and gx, gy, each over √(c² + |g|²)

where c says from which slope on a point mirrors no more to where it did. F of the untouched pad is 0.

Left out: the deformed top itself, so the walls' part in the contact, but for what V learns of it; friction and sideways
motion; objects of another reflectance than the tip's; light that meets the dimple more than once, but for what V learns
of it. `errors` says what that costs, by kind of object, at states that were not used for the fit.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError
from optopad.design.files import require_file, whole_file
from optopad.design.plain_arrays import plain_arrays
from optopad.design.shape.top import Top
from optopad.design.spec import SensorDesign
from optopad.sims.cache import cache_folder
from optopad.sims.learning.inference.signal_map import TensorSpline
from optopad.sims.robot.shapes import Shape, overlap_mm

Single = NDArray[np.float32]

SHARP_MM = 0.05
"""Width of the step from free to touched [mm]."""
WIDTHS, BENDS = (0.13, 0.33), (0.1, 0.05)
"""Standard deviations of the neighbourhoods, over the layer's thickness, and their constants c [-]."""
FAINT_MM = np.float32(1e-3)
"""t without an object, which is taken off [mm]."""
FARTHEST = 5.0
"""Standard deviations at which a neighbourhood ends; its weights would soon be too small for fast arithmetic."""
SCALARS = 5
"""Channels without a direction come first: step, root, t, and |g|² of both neighbourhoods."""
CHANNELS = SCALARS + 4 * len(WIDTHS)
LIKE_TIP = 0.1
"""Largest relative difference from the tip's radius of a ball that counts as one like the tip [-]."""
PER_CELL = 2
"""Nodes along each side of a cell."""
AWAY_MM = -9.0
"""Overlap where no object is over a node [mm]."""
TOP_ROUNDS = 4
MOST_BYTES = 200_000_000
FOLDER, SUFFIX, VERSION = "robot-light", ".npz", 1
NEEDED = "a map of light, which `optopad scene DESIGN --fit` writes"


@dataclass(frozen=True, kw_only=True, eq=False)
class Imprint:
    """Where objects reach below the untouched top, in n states.

    Attributes
    ----------
    overlap_mm : (n, node) overlap by the deepest object, negative for a gap [mm]
    balls_mm : (n, ball, 3) x, y and depth at which each ball like the tip touches [mm]; NaN for none
    deepest_mm : (n,) largest depth of the objects [mm]
    """

    overlap_mm: Single
    balls_mm: FloatArray
    deepest_mm: FloatArray

    def __len__(self) -> int:
        return len(self.overlap_mm)

    def among(self, rows: Sequence[int], count: int) -> Imprint:
        """The same at some rows of `count` states; there is no object in the others."""
        if len(rows) == count:
            return self
        overlap = np.full((count, self.overlap_mm.shape[1]), AWAY_MM, np.float32)
        balls = np.full((count, *self.balls_mm.shape[1:]), np.nan)
        deepest = np.full(count, AWAY_MM)
        overlap[rows], balls[rows], deepest[rows] = self.overlap_mm, self.balls_mm, self.deepest_mm
        return Imprint(overlap_mm=overlap, balls_mm=balls, deepest_mm=deepest)

    def scaled(self, factor: float) -> Imprint:
        """The same with all overlaps and depths times a factor."""
        scale = np.array([1.0, 1.0, factor])
        return Imprint(
            overlap_mm=self.overlap_mm * np.float32(factor),
            balls_mm=self.balls_mm * scale,
            deepest_mm=self.deepest_mm * factor,
        )

    def limited(self, most_mm: float) -> Imprint:
        """The same with the objects of deeper states lifted to a depth."""
        if not (self.deepest_mm > most_mm).any():
            return self
        lift = np.maximum(self.deepest_mm - most_mm, 0.0)
        balls = self.balls_mm.copy()
        balls[..., 2] -= lift[:, None]
        return Imprint(
            overlap_mm=self.overlap_mm - lift[:, None].astype(np.float32),
            balls_mm=balls,
            deepest_mm=np.minimum(self.deepest_mm, most_mm),
        )


def together(imprints: Sequence[Imprint]) -> Imprint:
    """The imprint of several objects in the same states."""
    if len(imprints) == 1:
        return imprints[0]
    return Imprint(
        overlap_mm=np.maximum.reduce([one.overlap_mm for one in imprints]),
        balls_mm=np.concatenate([one.balls_mm for one in imprints], axis=1),
        deepest_mm=np.maximum.reduce([one.deepest_mm for one in imprints]),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Nodes:
    """The grid of nodes on the untouched top.

    Attributes
    ----------
    x_mm, y_mm : (nx,), (ny,) lines of the grid, an even number; it covers the pad
    points_mm : (nx ny, 3) nodes in cavity coordinates
    normals : (nx ny, 3) outward normals there, or one (1, 3) on a flat top
    inside : (nx ny,) whether a node is in the pad; others never touch
    thickness_mm : thickness of the elastic layer at its highest point
    """

    x_mm: FloatArray
    y_mm: FloatArray
    points_mm: FloatArray
    normals: FloatArray
    inside: NDArray[np.bool_]
    thickness_mm: float

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.inside) // PER_CELL**2

    @property
    def cell_lines_mm(self) -> tuple[FloatArray, FloatArray]:
        """Lines x and y of the cells' middles."""
        x, y = (line.reshape(-1, PER_CELL).mean(axis=1) for line in (self.x_mm, self.y_mm))
        return x, y

    def contain(self, places_mm: FloatArray) -> NDArray[np.bool_]:
        """Whether the nodes nearest to places (n, 2 or more) are in the pad."""
        steps = np.rint((places_mm[:, :2] - (self.x_mm[0], self.y_mm[0])) / self.pitch_mm)
        shape = len(self.x_mm), len(self.y_mm)
        is_near = ((steps >= 0.0) & (steps < shape)).all(axis=1)
        i, j = np.where(is_near[:, None], np.nan_to_num(steps), 0.0).astype(np.int64).T
        return np.asarray(is_near & self.inside[i * shape[1] + j])

    @property
    def pitch_mm(self) -> float:
        """Distance of the nodes."""
        return float(self.x_mm[1] - self.x_mm[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class FastLight:
    """The light of a pad under objects; see the module.

    Attributes
    ----------
    digest : digest of the design
    top : the untouched top
    nodes : where overlaps are taken
    tip_radius_mm : radius of the tip of `tip`
    tip : √(light / untouched light) under the tip, over x, y and √depth
    weights : (channel x cell, pair) V of the module [-]
    untouched : (emitter, receiver) flux of the untouched pad, as a share of the emitted power [-]
    deepest_mm : largest depth that the fit covers
    states : number of states of the fit
    errors : root mean square error of the light over untouched light, by kind of object, at other states [-]
    """

    digest: str
    top: Top
    nodes: Nodes
    tip_radius_mm: float
    tip: TensorSpline
    weights: Single
    untouched: FloatArray
    deepest_mm: float
    states: int
    errors: dict[str, float]

    def imprint(self, shape: Shape, centre_mm: FloatArray, turn: FloatArray) -> Imprint:
        """Imprint of a shape in n poses.

        Parameters
        ----------
        centre_mm, turn : (n, 3) centres and (n, 3, 3) rotations in cavity coordinates; columns are the shape's axes
        """
        found = self._overlap_mm(shape, centre_mm, turn)
        radius_mm = float(shape.size_mm[0])
        if shape.kind != "sphere" or abs(radius_mm / self.tip_radius_mm - 1.0) > LIKE_TIP:
            balls = np.empty((len(found), 0, 3))
            deepest = found.max(axis=1).astype(np.float64)
            return Imprint(overlap_mm=found, balls_mm=balls, deepest_mm=deepest)
        ball = self._contact_mm(centre_mm, radius_mm)
        ball[~self.nodes.contain(ball)] = np.nan, np.nan, AWAY_MM
        return Imprint(overlap_mm=found, balls_mm=ball[:, None], deepest_mm=ball[:, 2])

    def ratios(self, imprint: Imprint) -> FloatArray:
        """Light over untouched light (n, emitter, receiver); exactly 1 where nothing touches."""
        pressed = imprint.limited(self.deepest_mm)
        ratio, features = self.parts(pressed)
        if features.any():
            ratio += features @ self.weights
        ratio[pressed.deepest_mm <= 0.0] = 1.0
        return np.maximum(ratio, 0.0).reshape(-1, *self.untouched.shape)

    def parts(self, imprint: Imprint) -> tuple[FloatArray, Single]:
        """The product (n, pair) over balls, and F(o) - Σ F(o_i) (n, channel x cell); see the module."""
        ratio: FloatArray = np.ones((len(imprint), self.untouched.size))
        overlap = imprint.overlap_mm
        of_tips = []
        for k in range(imprint.balls_mm.shape[1]):
            rows = np.flatnonzero(imprint.balls_mm[:, k, 2] > 0.0)
            if rows.size:
                at = self._in_map(imprint.balls_mm[rows, k])
                ratio[rows] *= np.square(self.tip.values(at))
                of_tips.append((rows, self._tip_overlap_mm(at)))
        if (
            len(of_tips) == 1
            and len(of_tips[0][0]) == len(imprint)
            and np.array_equal(of_tips[0][1], overlap)
        ):
            return ratio, np.zeros((len(imprint), len(self.weights)), np.float32)
        found = self.features(overlap)
        for rows, own in of_tips:
            found[rows] -= self.features(own)
        return ratio, found

    def features(self, overlap_mm: Single) -> Single:
        """F (n, channel x cell) of overlaps (n, node)."""
        (mean_x, slope_x), (mean_y, slope_y) = self.neighbourhoods
        shape = (len(overlap_mm), len(self.nodes.x_mm), len(self.nodes.y_mm))
        overlap = overlap_mm.reshape(shape)
        found = np.empty((shape[0], CHANNELS, shape[1] // PER_CELL, shape[2] // PER_CELL), np.float32)
        steep = np.exp(np.minimum(overlap / -np.float32(SHARP_MM), np.float32(30.0)))
        found[:, 0] = _in_cells(np.float32(1.0) / (np.float32(1.0) + steep))
        deep = np.maximum(overlap, np.float32(0.0))
        found[:, 1] = _in_cells(np.sqrt(deep))
        deep *= deep
        deep *= deep
        along = deep[:, None] @ mean_y
        mean = mean_x @ along + FAINT_MM**4
        t = np.sqrt(np.sqrt(mean))
        np.subtract(t[:, 0], FAINT_MM, out=found[:, 2])
        t /= np.float32(4.0) * mean
        gx, gy = slope_x @ along, mean_x @ (deep[:, None] @ slope_y)
        gx *= t
        gy *= t
        xx, yy = gx * gx, gy * gy
        share = np.float32(1.0) / (xx + yy + _BENDS)
        np.multiply(xx + yy, share, out=found[:, SCALARS - len(WIDTHS) : SCALARS])
        many = found[:, SCALARS:].reshape(shape[0], 4, len(WIDTHS), *found.shape[2:])
        np.multiply(xx - yy, share, out=many[:, 0])
        np.multiply(gx * gy, share, out=many[:, 1])
        np.sqrt(share, out=share)
        np.multiply(gx, share, out=many[:, 2])
        np.multiply(gy, share, out=many[:, 3])
        return found.reshape(shape[0], -1)

    @cached_property
    def neighbourhoods(self) -> tuple[tuple[Single, Single], tuple[Single, Single]]:
        """Matrices (width, cell, node) of means along x and of their slopes there; the same, transposed, along y."""
        nodes = self.nodes
        found = []
        for line, cells, is_y in zip(
            (nodes.x_mm, nodes.y_mm), nodes.cell_lines_mm, (False, True), strict=True
        ):
            widths = nodes.thickness_mm * np.array(WIDTHS)[:, None, None]
            away = (cells[:, None] - line) / widths
            weight = np.where(np.abs(away) < FARTHEST, np.exp(-0.5 * away**2), 0.0)
            weight /= weight.sum(axis=2).max(axis=1)[:, None, None]
            pair = [one.swapaxes(1, 2) if is_y else one for one in (weight, -weight * away / widths)]
            found.append([np.ascontiguousarray(one, dtype=np.float32) for one in pair])
        return (found[0][0], found[0][1]), (found[1][0], found[1][1])

    @cached_property
    def _grid(self) -> tuple[Single, Single, NDArray[np.bool_]]:
        """Nodes, normals, and which nodes are outside the pad, for overlaps in single precision."""
        nodes = self.nodes
        return nodes.points_mm.astype(np.float32), nodes.normals.astype(np.float32), ~nodes.inside

    def _overlap_mm(self, shape: Shape, centre_mm: FloatArray, turn: FloatArray) -> Single:
        points, normals, outside = self._grid
        given = overlap_mm(shape, centre_mm.astype(np.float32), turn.astype(np.float32), points, normals)
        found: Single = np.maximum(given, np.float32(AWAY_MM)).astype(np.float32, copy=False)
        if outside.any():
            found[:, outside] = AWAY_MM
        return found

    def _tip_overlap_mm(self, press_mm: FloatArray) -> Single:
        """Overlap (n, node) of the tip at presses (n, 3)."""
        x, y, depth = press_mm.T
        normal = self.top.normal(x, y)
        centre = (
            np.column_stack([x, y, self.top.height_mm(x, y)]) + normal * (self.tip_radius_mm - depth)[:, None]
        )
        tip = Shape(kind="sphere", size_mm=np.array([self.tip_radius_mm, 0.0, 0.0]))
        return self._overlap_mm(tip, centre, np.broadcast_to(np.eye(3), (len(x), 3, 3)))

    def _contact_mm(self, centre_mm: FloatArray, radius_mm: float) -> FloatArray:
        """x, y and depth (n, 3) at which balls touch the untouched top, by the normal through their centres."""
        x, y = centre_mm[:, 0], centre_mm[:, 1]
        height: FloatArray = centre_mm[:, 2] - self.top.clear_mm
        if not self.top.is_flat:
            for _ in range(TOP_ROUNDS):
                normal = self.top.normal(x, y)
                foot = np.column_stack([x, y, self.top.height_mm(x, y)])
                height = np.einsum("ni,ni->n", centre_mm - foot, normal)
                x, y = (centre_mm - height[:, None] * normal)[:, :2].T
        return np.column_stack([x, y, radius_mm - height])

    def _in_map(self, press_mm: FloatArray) -> FloatArray:
        """Presses (n, 3) moved to the nearest ones that the tip's spline covers."""
        end = np.array([*self.tip.end[:2], self.tip.deepest_mm])
        return np.clip(press_mm, [*self.tip.start[:2], 0.0], end)

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write the map to a file, completely or not at all."""
        arrays: dict[str, Any] = {}
        for name, part in (("nodes", self.nodes), ("tip", self.tip)):
            arrays |= {f"{name}.{field.name}": getattr(part, field.name) for field in fields(part)}
        thickness_mm = arrays.pop("nodes.thickness_mm")
        header = {
            "version": VERSION,
            "digest": self.digest,
            "top": asdict(self.top),
            "thickness_mm": thickness_mm,
            "tip_radius_mm": self.tip_radius_mm,
            "deepest_mm": self.deepest_mm,
            "states": self.states,
            "errors": self.errors,
        }
        arrays |= {"untouched": self.untouched, "weights": self.weights}
        arrays["header"] = np.frombuffer(json.dumps(header, allow_nan=False).encode(), np.uint8)
        with whole_file(Path(file)) as hidden, hidden.open("wb") as stream:
            np.savez(stream, **arrays)


_BENDS = np.square(np.array(BENDS, np.float32))[:, None, None]


def _in_cells(field: Single) -> Single:
    """Means (n, nx, ny) of fields at nodes over the nodes of each cell."""
    half = field[:, ::PER_CELL] + field[:, 1::PER_CELL]
    return np.asarray((half[..., ::PER_CELL] + half[..., 1::PER_CELL]) * np.float32(1.0 / PER_CELL**2))


def light_file(design: SensorDesign) -> Path:
    """The file in the cache folder in which a design's map of light is kept."""
    return cache_folder() / FOLDER / f"{design.digest}{SUFFIX}"


def fast_light(design: SensorDesign) -> FastLight:
    """The map of light that was fitted for a design.

    Raises
    ------
    InputError : there is none, or it is damaged.
    """
    file = light_file(design)
    if not file.is_file():
        raise InputError(
            f"{design.name}: has no map of light for simulation yet; run `optopad scene DESIGN --fit` once: it takes "
            "about 20 minutes on 2 cores, and the map stays in the cache"
        )
    return load_fast_light(file)


def light_of(design: SensorDesign, file: str | os.PathLike[str] | None) -> FastLight:
    """The map of light of a design: that of a file or, if it is None, the one in the cache."""
    return fast_light(design) if file is None else load_fast_light(file)


def require_light_of(design: SensorDesign, digest: str) -> None:
    """Refuse a map of light of another design, whose digest is given."""
    if digest != design.digest:
        raise InputError(
            f"light: of design {digest[:8]}, the pad's is {design.digest[:8]}; run `optopad scene DESIGN --fit` "
            "on the pad's design"
        )


def load_fast_light(file: str | os.PathLike[str]) -> FastLight:
    """Read a map of light from a file.

    Raises
    ------
    InputError : the file is missing or damaged, or of another version.
    """
    path = Path(file)
    require_file(path, needed=NEEDED)
    try:
        arrays = plain_arrays(path, most_bytes=MOST_BYTES)
        header = json.loads(arrays.pop("header").tobytes())
        if header["version"] != VERSION:
            raise InputError(f"{path}: is of another version of optopad; fit it again")
        parts: dict[str, dict[str, Any]] = {"nodes": {}, "tip": {}}
        for name, value in arrays.items():
            part, _, key = name.partition(".")
            if key:
                parts[part][key] = value
        return FastLight(
            digest=str(header["digest"]),
            top=_top_of(**header["top"]),
            nodes=Nodes(**parts["nodes"], thickness_mm=float(header["thickness_mm"])),
            tip_radius_mm=float(header["tip_radius_mm"]),
            tip=TensorSpline(**parts["tip"]),
            weights=arrays["weights"],
            untouched=arrays["untouched"],
            deepest_mm=float(header["deepest_mm"]),
            states=int(header["states"]),
            errors={str(kind): float(error) for kind, error in header["errors"].items()},
        )
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise InputError(f"{path}: is no map of light, or it is damaged ({err}); needs {NEEDED}") from None


def _top_of(clear_mm: float, apex_mm: Sequence[float], kx: float, ky: float) -> Top:
    x, y = apex_mm
    return Top(clear_mm=clear_mm, apex_mm=(x, y), kx=kx, ky=ky)


def draft_nodes(draft: Draft, cell_mm: float) -> Nodes:
    """Nodes on a draft's top, in cells of about a size."""
    plan, cavity = draft.plan, draft.design.cavity
    border = np.concatenate([edge.points(np.linspace(0.0, 1.0, 65)) for edge in plan.outline.loop])
    low, high = border.min(axis=0), border.max(axis=0)
    step = float(np.mean((high - low) / np.maximum(np.round((high - low) / cell_mm), 2.0))) / PER_CELL
    counts = PER_CELL * np.ceil((high - low) / (PER_CELL * step) - 1e-6).astype(int)
    x, y = ((low[k] + high[k]) / 2 + step * (np.arange(counts[k]) - (counts[k] - 1) / 2) for k in range(2))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    height = plan.top.height_mm(*places.T)
    inside = (plan.outline.gap_mm(*places.T) > 0.0) & np.isfinite(height)
    normals = plan.top.normal(*places.T)
    normals[~inside] = (0.0, 0.0, 1.0)
    return Nodes(
        x_mm=x,
        y_mm=y,
        points_mm=np.column_stack([places, np.where(inside, height, plan.top.clear_mm)]),
        normals=np.array([[0.0, 0.0, 1.0]]) if plan.top.is_flat else normals,
        inside=inside,
        thickness_mm=cavity.elastic_mm,
    )
