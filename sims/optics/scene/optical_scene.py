"""The optical scene as plain typed arrays: the only input of the light kernels and of the reference ray tracer.

Coordinates
-----------
x runs from 0 to the inner length and y from 0 to the inner width. z is 0 at the bottom of the clear layer; at the
undisturbed top it equals the layer's thickness. Walls are numbered 0 south (y = 0), 1 east (x = length), 2 north (y =
width), 3 west (x = 0). The active area of an emitter or receiver is a rectangle on a wall, called a patch. It is given
by its centre along the wall (x for south and north, y for east and west), its centre height, and two half sizes. Only
the part of a patch below the top emits or receives. An emitter's flux is a fraction of the power that its *whole* area
would emit.

Faces with a pose
-----------------
The face of a part that stands on the floor does not lie on a wall. Its pose is the centre x, y, z, the tilt t (0 looks
up, 90 degrees looks level) and the turn a, the plan direction in which a tilted face looks:

    normal into the elastomer  (cos a sin t, sin a sin t, cos t)
    width axis                 (-sin a, cos a, 0)
    height axis                (-cos a cos t, -sin a cos t, sin t)

The face is thin and has one side. Light that arrives from the side of the normal meets the face: a receiver counts its
response and absorbs the light; an emitter's face absorbs or scatters it as the floor does. Light from the other side
passes. The part's body is left out and hides no light.

Skin of the top
---------------
A skin reflects the share `top_reflectance` of the light that arrives from inside and absorbs the rest. A specular skin
mirrors this share, a diffuse one scatters it (Lambertian). No light passes a skin, so an object that touches its
outside changes only the shape of the top; `tip_reflectance` then has no effect.

Angular properties of a patch are tables over the cosine c to its inward normal, at nodes `np.linspace(0, 1, n)`, linear
between them.

Pads of other shape (`PadForm`)
-------------------------------
In plan the elastomer is convex. A point p is inside if n · (p - o) <= 0 for every flat wall, and |p - c| <= r for every
round wall with p in the sector of its centre c. The bottom is the plane z = 0; the top is a
`optopad.design.shape.top.Top`.

Response of a receiver
----------------------
The response is the share of light arriving from inside the elastomer that a receiver counts, by angle. Elastomer of
index n covers the receiver's flat face; behind the face is epoxy of index n_e with the chip. Light at angle a in the
elastomer enters the epoxy at angle e, n sin a = n_e sin e (Snell). The unpolarised Fresnel share T(n -> n_e, a) = 1 -
(R_s + R_p) / 2 enters (Hecht, Optics, eqs 4.34 to 4.62), and the chip counts the share q(e) of it:

    response(cos a) = T(n -> n_e, a) q(e),   q(0) = 1.

So at normal incidence T(n -> n_e, 0) is counted, 0.998 for silicone against common epoxy. A bare receiver, whose part
has no epoxy index, counts 1 at every angle. One common gain scales all signals, so only ratios between angles matter.

The chip's own q follows from the data sheet's response S(b) in air, through the same face and relative to the axis:
S(b) = cos b T(1 -> n_e, b) / T(1 -> n_e, 0) q(e), sin b = n_e sin e.

* From a table, q is S divided by the other two factors, at most 1: a table that was rounded to a cosine gives a little
  more. It is valid up to the table's last angle or `FARTHEST_DEG`, whichever is smaller. Light at larger angles in the
  epoxy cannot come from air; it is assumed to count as much as at that angle.
* From a half angle h, q = cos^p e, where p, 0 or more, gives S(h) = 1/2. A half angle of 60 degrees or more gives p =
  0, a flat chip that counts all light equally.

The table of T has 129 nodes. If the epoxy's index is above the elastomer's, its error is 1e-5 of diffuse light. If it
is below, the critical angle is rounded off within a cell, with an error of 1.6e-3 at most (scan of indices).

The model leaves out lenses (bedded in elastomer they lose their power; `check` warns), reflection at the chip, light
lost at the epoxy's side faces, and polarisation.

Pattern of an emitter
---------------------
A pattern is the radiance L(c) of a flat patch, divided by its power per area [1/sr]. Its power into the half space, 2
pi int_0^1 c L(c) dc, is integrated exactly: a cell of width h from node a to node b adds h / 6 (c_a (2 L_a + L_b) + c_b
(L_a + 2 L_b)).

A data sheet's table of the intensity I over the angle becomes L(c) = I / c at every node but c = 0. There L has the
value, 0 or more, with which the first cell has the sheet's power. It stays bounded even if the sheet shows light at 90
degrees, which a flat face cannot emit. The pattern is then scaled to unit power. Sheets give emission into air. The
pattern, like a half angle, is assumed to hold in the elastomer, too, without refraction at the face. A Lambertian
source behind a flat face stays Lambertian except for Fresnel losses.

Smooth height field
-------------------
The field is the part of the pressed top's height that is not axisymmetric. Between nodes it is the bicubic Hermite
patch through value, both slopes and mixed derivative at the four corners of a cell; value and slope are continuous.
Outside its grid the field is 0. The caller has to ensure that field and slope vanish at the grid's border, or that the
border is on or beyond the walls. The nodes' derivatives come from the C2 bicubic spline through the heights (not-a-knot
ends). If heights are sampled more closely than the nodes, these are nearly the derivatives of the height itself, so
even a steep height needs few nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.errors import InputError
from optopad.design.parts.angular import AngularTable
from optopad.design.parts.catalog import Part
from optopad.design.shape.top import Top

WALL_COLUMNS = ("x", "y", "tx", "ty", "nx", "ny")
ARC_COLUMNS = ("x", "y", "radius", "ux", "uy", "cosine")
POSE_COLUMNS = ("x", "y", "z", "tilt", "turn")
WHOLE_CIRCLE = (0.0, 0.0, -1.0)
"""Stands in `PadForm.arcs` for the sector of a round wall that is a whole circle."""


@dataclass(frozen=True, kw_only=True, repr=False)
class PadForm:
    """Walls and top of a pad that is not a rectangular block with a flat top; the pad is convex in plan.

    Attributes
    ----------
    walls : (k, 6) flat walls by `WALL_COLUMNS`: x, y of the point from which positions along the wall are measured
        [mm]; unit tangent along which these positions increase [-]; unit outward normal [-]
    arcs : (m, 6) round walls by `ARC_COLUMNS`: x, y of the axis, and radius [mm]; then the sector in which the circle
        serves as the wall: unit direction from the axis to the sector's middle, and cosine of half its angle [-], or
        `WHOLE_CIRCLE`
    top : the untouched top; its highest point is the scene's height
    """

    walls: FloatArray
    arcs: FloatArray
    top: Top

    def __repr__(self) -> str:
        """Text with all digits of each number, so only equal forms have the same text."""
        walls, arcs = np.asarray(self.walls).tolist(), np.asarray(self.arcs).tolist()
        return f"PadForm(walls={walls}, arcs={arcs}, top={self.top!r})"


FARTHEST_DEG = 80.0
"""Largest angle in air that is used of a data sheet's response table [deg]: near 90 degrees the response of the chip is
the ratio of two small numbers."""


def transmitted_share(cosine: FloatArray, index_from: float, index_to: float) -> FloatArray:
    """Unpolarised Fresnel transmission of power at a flat interface.

    Parameters
    ----------
    cosine : (...,) cosine of the angle of incidence, 0 to 1 [-]
    index_from, index_to : index before and behind the interface [-]

    Returns
    -------
    (...,) transmitted share of the power; 0 beyond the critical angle [-]
    """
    c = np.asarray(cosine, dtype=np.float64)
    if index_from == index_to:
        return np.ones_like(c)
    inner = refracted_cosine(c, index_from, index_to)
    c = np.where(inner > 0.0, c, 1.0)  # no light passes there; this only avoids 0 / 0
    s = (index_from * c - index_to * inner) / (index_from * c + index_to * inner)
    p = (index_to * c - index_from * inner) / (index_to * c + index_from * inner)
    share = 1.0 - (s * s + p * p) / 2.0
    return np.asarray(np.where(inner > 0.0, share, 0.0))


def refracted_cosine(cosine: FloatArray, index_from: float, index_to: float) -> FloatArray:
    """(...,) cosine of the refracted angle by Snell's law; 0 at the critical angle and beyond [-]."""
    sine = index_from / index_to * np.sqrt(1.0 - np.asarray(cosine, dtype=np.float64) ** 2)
    return np.asarray(np.sqrt(np.clip(1.0 - sine * sine, 0.0, None)))


COSINE_NODES = 129
GRAZING_NODES = 32


def cosine_nodes(count: int = COSINE_NODES) -> FloatArray:
    """(count,) cosines from 0 (grazing) to 1 (along the normal) at which angular tables are given [-]."""
    return np.linspace(0.0, 1.0, count)


def response_nodes(part: Part, refractive_index: float, count: int = COSINE_NODES) -> FloatArray:
    """Response table of a receiver: the share of arriving light that it counts, by cosine.

    Parameters
    ----------
    part : the receiver
    refractive_index : index of the elastomer [-]
    count : number of nodes (`cosine_nodes`)

    Returns
    -------
    (count,) share of the arriving light that is counted, 0 to 1 [-]; all 1 for a bare receiver
    """
    if part.epoxy_index is None:
        return np.ones(count)
    cosine, epoxy = cosine_nodes(count), part.epoxy_index.value
    inner = refracted_cosine(cosine, refractive_index, epoxy)
    if part.angular_response is None:
        counted = inner ** half_angle_power(part.half_angle_deg.value, epoxy)
    else:
        counted = _counted_by_table(part.angular_response, inner, epoxy)
    return np.asarray(transmitted_share(cosine, refractive_index, epoxy) * counted)


def half_angle_power(half_angle_deg: float, epoxy_index: float) -> float:
    """Exponent p, 0 or more, with which the chip's response cos^p in epoxy gives 1/2 in air at the half angle [-]."""
    outer = np.cos(np.radians(half_angle_deg))
    face = float(outer * _relative_entry(outer, epoxy_index))
    inner = float(refracted_cosine(outer, 1.0, epoxy_index))
    return max(0.0, float(np.log(0.5 / face) / np.log(inner)))


def _counted_by_table(table: AngularTable, inner: FloatArray, epoxy_index: float) -> FloatArray:
    """(n,) the chip's response q at cosines `inner` in the epoxy, from a data sheet's table of the response in air."""
    sine = np.minimum(epoxy_index * np.sqrt(1.0 - inner * inner), 1.0)
    angle = np.minimum(np.degrees(np.arcsin(sine)), min(FARTHEST_DEG, table.last_deg))
    outer = np.cos(np.radians(angle))
    seen = table.at(angle) / table.relative[0]
    return np.minimum(seen / (outer * _relative_entry(outer, epoxy_index)), 1.0)


def _relative_entry(outer: FloatArray, epoxy_index: float) -> FloatArray:
    """(...,) transmission from air into epoxy at cosines `outer`, relative to that at normal incidence [-]."""
    on_axis = transmitted_share(np.ones(()), 1.0, epoxy_index)
    return np.asarray(transmitted_share(outer, 1.0, epoxy_index) / on_axis)


def pattern_power(radiance: FloatArray) -> FloatArray:
    """(...,) power of (..., n) patterns; 1 if they are normalised [-]."""
    c = cosine_nodes(np.shape(radiance)[-1])
    low, high = radiance[..., :-1], radiance[..., 1:]
    cells = c[:-1] * (2 * low + high) + c[1:] * (low + 2 * high)
    return np.asarray(2 * np.pi * np.sum(cells, axis=-1) * (c[1] - c[0]) / 6)


def normalised_pattern(radiance: FloatArray) -> FloatArray:
    """Scale (..., n) patterns of any power to unit power.

    Raises
    ------
    InputError : a pattern has no power, or a value that is negative or not finite.
    """
    values = np.asarray(radiance, dtype=np.float64)
    power = pattern_power(values)
    if not (np.isfinite(values).all() and (values >= 0).all() and (power > 0).all()):
        raise InputError("pattern: must be finite, not negative, and above 0 somewhere; correct its table")
    return values / power[..., None]


def lambertian_pattern(order: float, count: int = COSINE_NODES) -> FloatArray:
    """(count,) pattern of the intensity cos^order, order 1 or more: exact at order 1 and 2, else linear between nodes.

    Raises
    ------
    InputError : the order is below 1, so its radiance has no bound at grazing angles.
    """
    if not 1.0 <= order < np.inf:
        raise InputError(f"order: {order:g}, a table needs 1 or more; give emitter_order instead")
    return normalised_pattern(cosine_nodes(count) ** (order - 1.0))


def table_pattern(table: AngularTable, count: int = COSINE_NODES) -> FloatArray:
    """(count,) pattern of unit power at the cosine's nodes, from a data sheet's table of intensity over angle."""
    c = cosine_nodes(count)
    radiance = np.zeros(count)
    radiance[1:] = table.at(np.degrees(np.arccos(c[1:]))) / c[1:]
    within, weights = np.polynomial.legendre.leggauss(GRAZING_NODES)
    grazing = c[1] * (within + 1) / 2
    power = c[1] / 2 * np.sum(weights * table.at(np.degrees(np.arccos(grazing))))
    radiance[0] = max(0.0, 6 * power / c[1] ** 2 - 2 * radiance[1])
    return normalised_pattern(radiance)


MIN_CELLS = 4
"""Smallest number of cells per side. A bicubic spline needs four points per side; one more cell separates its ends."""
MAX_NODES = 1_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothField:
    """A height that is added to the top, on a regular grid; the module's docstring explains the interpolation.

    Attributes
    ----------
    origin_mm : (2,) x and y of the first node in cavity coordinates [mm]
    step_mm : (2,) distance between nodes along x and y [mm]
    nodes : (nx, ny, 4) value [mm], slope along x [-], slope along y [-], mixed derivative [1/mm] at x_i = x_0 + i dx,
        y_j = y_0 + j dy

    Raises
    ------
    InputError : a shape is wrong, a step is not above 0, or a value is not finite.
    """

    origin_mm: FloatArray
    step_mm: FloatArray
    nodes: FloatArray

    def __post_init__(self) -> None:
        """Refuse wrong shapes, steps and values; see `SmoothField`."""
        for name in ("origin_mm", "step_mm"):
            values = np.asarray(getattr(self, name))
            if values.shape != (2,) or not np.isfinite(values).all():
                raise InputError(f"{name}: {values}, needs two finite numbers, of x and y")
        if not (np.asarray(self.step_mm) > 0).all():
            raise InputError(f"step_mm: {self.step_mm}, must be above 0 mm along x and y")
        shape = np.shape(self.nodes)
        if len(shape) != 3 or shape[2] != 4 or min(shape[:2]) < 2:
            raise InputError(f"nodes: shape {shape}, needs (2 or more, 2 or more, 4)")
        if not np.isfinite(self.nodes).all():
            i, j, k = np.argwhere(~np.isfinite(self.nodes))[0]
            raise InputError(f"nodes[{i}, {j}, {k}]: {self.nodes[i, j, k]}, must be finite")

    def height_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """(...,) height [mm] at (...,) points in cavity coordinates [mm]; 0 outside the grid."""
        u, i = _cell(np.asarray(x_mm, dtype=np.float64), self.origin_mm[0], self.step_mm[0], len(self.nodes))
        v, j = _cell(
            np.asarray(y_mm, dtype=np.float64), self.origin_mm[1], self.step_mm[1], self.nodes.shape[1]
        )
        inside = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        along, across = _hermite(u, self.step_mm[0]), _hermite(v, self.step_mm[1])
        total = np.zeros(np.broadcast(u, v).shape)
        for a in range(2):
            for b in range(2):
                node = self.nodes[i + a, j + b]
                total += node[..., 0] * along[a][0] * across[b][0] + node[..., 1] * along[a][1] * across[b][0]
                total += node[..., 2] * along[a][0] * across[b][1] + node[..., 3] * along[a][1] * across[b][1]
        return np.where(inside, total, 0.0)


def smooth_field(
    height_mm: Callable[[FloatArray, FloatArray], FloatArray],
    length_mm: float,
    width_mm: float,
    spacing_mm: float,
    finer: int = 1,
) -> SmoothField:
    """Sample a height over the whole pad, from wall to wall.

    Parameters
    ----------
    height_mm : function that takes x (nx, 1) and y (1, ny) in cavity coordinates [mm] and returns (nx, ny) heights [mm]
    length_mm, width_mm : size of the cavity [mm]
    spacing_mm : largest distance between neighbouring nodes [mm]; the actual distance is such that the grid ends at the
        walls
    finer : number of height samples per distance between nodes; the nodes' derivatives are computed from these samples

    Raises
    ------
    InputError : a size or spacing is not above 0, there are too many nodes, or heights are not finite.
    """
    for name, value in (("length_mm", length_mm), ("width_mm", width_mm), ("spacing_mm", spacing_mm)):
        if not 0 < value < np.inf:
            raise InputError(f"{name}: {value:g} mm, must be above 0")
    counts = [max(MIN_CELLS, int(np.ceil(size / spacing_mm - 1e-9))) + 1 for size in (length_mm, width_mm)]
    if counts[0] * counts[1] > MAX_NODES:
        raise InputError(
            f"spacing_mm: {spacing_mm:g} mm makes {counts[0]} x {counts[1]} nodes, at most {MAX_NODES}; widen it"
        )
    x, y = (
        np.linspace(0.0, size, (count - 1) * finer + 1)
        for size, count in zip((length_mm, width_mm), counts, strict=True)
    )
    values = np.asarray(height_mm(x[:, None], y[None, :]), dtype=np.float64)
    if values.shape != (len(x), len(y)):
        raise InputError(
            f"height_mm: gave shape {values.shape} for {len(x)} x {len(y)} points; give one height each"
        )
    step = np.array([x[finer], y[finer]])
    return SmoothField(origin_mm=np.zeros(2), step_mm=step, nodes=spline_nodes(x, y, values, finer))


def spline_nodes(x: FloatArray, y: FloatArray, heights: FloatArray, finer: int) -> FloatArray:
    """(nx, ny, 4) value, slopes along x and y, and mixed derivative, at every `finer`-th point, of a bicubic spline.

    Parameters
    ----------
    x, y : (n,), (m,) evenly spaced coordinates from 0 [mm]
    heights : (n, m) heights at these points [mm]

    Raises
    ------
    InputError : a height is not finite.
    """
    if not np.isfinite(heights).all():
        i, j = np.argwhere(~np.isfinite(heights))[0]
        raise InputError(f"height_mm: {heights[i, j]} at ({x[i]:g}, {y[j]:g}) mm, must be finite everywhere")
    (rise_x, rise_y), kept = (
        (_spline_slopes(len(t), float(t[-1]), finer) for t in (x, y)),
        slice(None, None, finer),
    )
    along = rise_x @ heights
    columns = (heights[kept, kept], along[:, kept], heights[kept] @ rise_y.T, along @ rise_y.T)
    return np.stack(columns, axis=-1)


@lru_cache(maxsize=8)
def _spline_slopes(count: int, size: float, finer: int) -> FloatArray:
    """(node, count) matrix from values at `count` evenly spaced points on 0 to `size` to a spline's slopes at nodes.

    Every `finer`-th point is a node.
    """
    from scipy.interpolate import CubicSpline

    t = np.linspace(0.0, size, count)
    return np.asarray(CubicSpline(t, np.eye(count))(t[::finer], 1))


def _cell(place: FloatArray, origin: float, step: float, count: int) -> tuple[FloatArray, IntArray]:
    """Fraction of a coordinate within its grid cell (below 0 or above 1 outside the grid), and the cell's number."""
    t = (place - origin) / step
    cell = np.clip(np.floor(t), 0, count - 2).astype(np.int64)
    return t - cell, cell


def _hermite(
    t: FloatArray, step: float
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Weights of value and slope at a cell's first end, then at its second, in the cubic at fraction t of the cell."""
    s = 1.0 - t
    return ((1 + 2 * t) * s * s, step * t * s * s), ((1 + 2 * s) * t * t, -step * s * t * t)


@dataclass(frozen=True, kw_only=True)
class OpticalScene:
    """The clear elastomer with flat emitters and receivers on its walls; for coordinates see the module's docstring.

    Attributes
    ----------
    length_mm, width_mm, height_mm : size of the clear block along x, y, z [mm]
    refractive_index : refractive index of the elastomer relative to air [-]
    absorption_per_mm : natural-log absorption coefficient [1/mm]
    wall_reflectance, bottom_reflectance, tip_reflectance : diffuse (Lambertian) reflectance [-]
    emitter_wall : (e,) wall number of each emitter
    emitter_patch : (e, 4) centre along the wall, centre height z, half width along the wall, half height [mm], as
        mounted
    emitter_order : (e,) Lambertian order m of the intensity cos^m [-]; 1 is a Lambertian source
    receiver_wall : (r,) wall number of each receiver
    receiver_patch : (r, 4) columns as in `emitter_patch` [mm]
    emitter_pattern : (e, n) radiance L(c), divided by power per area, at the cosine's nodes [1/sr]: for unit power of
        the whole area the intensity is c L(c), so 2 pi int c L dc = 1. If an emitter's table row is NaN, its order is
        used; if the pattern is None, all emitters' orders are used, with L(c) = (m + 1) / (2 pi) c^(m - 1)
    receiver_response : (r, n) share, 0 to 1, of light arriving from inside the elastomer that is counted, at the
        cosine's nodes [-]. If None, 1 at every angle
    wall_index : refractive index of the material behind smooth walls [-]; 1 is an air gap. Such a wall mirrors the
        unpolarised Fresnel share, which is 1 beyond the critical angle. It scatters the share `wall_reflectance` of the
        rest and absorbs the remainder. Emitters' faces count as wall, receivers' faces do not. If None, walls only
        scatter. The bottom never mirrors
    form : walls and top of a pad that is not a rectangular block with a flat top; None for such a block. With a form,
        `height_mm` is the height of the highest point; `length_mm` and `width_mm` are the size in plan of the box
        around the pad, which begins at 0, 0. Wall numbers are then indices into `form.walls`, which also defines
        positions of patches along the walls. The part of a patch above the untouched top is not in the scene
    emitter_pose : (e, 5) `POSE_COLUMNS` of emitters' faces that do not lie on a wall: centre x, y, z [mm], tilt and
        turn [rad]. A row is NaN for an emitter on a wall. For a face with a pose the wall number is -1, and the patch
        row is 0, centre height z, half width, half height [mm]. If None, all emitters are on walls
    receiver_pose : (r, 5) receivers' poses, as in `emitter_pose`
    top_finish : "bare", or the finish of the opaque skin that covers the whole top: "specular" or "diffuse"
    top_reflectance : share of the arriving light that a skin reflects [-], at every angle of incidence and wherever the
        top is pressed; 0 for a bare top. Scenes with poses or a skin always have a `form`
    """

    length_mm: float
    width_mm: float
    height_mm: float
    refractive_index: float
    absorption_per_mm: float
    wall_reflectance: float
    bottom_reflectance: float
    tip_reflectance: float
    emitter_wall: IntArray
    emitter_patch: FloatArray
    emitter_order: FloatArray
    receiver_wall: IntArray
    receiver_patch: FloatArray
    emitter_pattern: FloatArray | None = None
    receiver_response: FloatArray | None = None
    wall_index: float | None = None
    form: PadForm | None = None
    emitter_pose: FloatArray | None = None
    receiver_pose: FloatArray | None = None
    top_finish: str = "bare"
    top_reflectance: float = 0.0
