r"""The linear response of a pad's top to pressure and sideways load: an elastic layer between the pad's own walls.

Lengths are in mm, loads in shear moduli. Loads and displacements have three components: along x and y in the top, and
normal to it, downward. A normal load is a pressure.

A layer without walls
---------------------
An incompressible layer of thickness h is bonded to a rigid floor. Its top is loaded by waves of wave number q: a
pressure p, and sideways tractions t along the wave vector and s across it. With k = q h, D = cosh² k + k², C = sinh k
cosh k and c = 1 / (2 μ q D), it moves by

    w = c ((C - k) p + i k² t)          downward
    u = c ((C + k) t - i k² p)          along the wave vector
    v = tanh k / (μ q) s                across it

For k → ∞ these are the half-space's, 1/(2 μ q) and 1/(μ q) (Johnson, Contact Mechanics, 1985, chapters 3 and 13). For
k → 0, w vanishes under pressure, since the layer keeps its volume, and u and v are those of simple shear, h/μ. All
follow from Stokes' equations with no motion at z = 0 and the load at z = h. Pressure and sideways motion are coupled
only in a layer: where the top is dragged along, it rises in front and sinks behind.

The walls, outline and crown of a pad (`PadLayer`)
--------------------------------------------------
The pad's response G is that of a wide layer, G_wide, plus a change S. Both have the same singularity 1 / (4 π μ r), so
S is smooth where load and place are not close to the same wall. Each component of it is represented by cubic B-splines
b of the plan coordinates x and y, as S(x, x') = Σ b_i(x) C_ij b_j(x'). With the inner product over the top's area,

    C = M⁻¹ (F - W) M⁻¹,   M_ij = <b_i, b_j>,   F_ij = <b_i, G b_j>,   W_ij = <b_i, G_wide b_j>.

F is computed with finite elements of the whole pad, W with Fourier transforms. C is symmetric, as Betti demands.

The finite elements are hexahedra with quadratic displacements and linear pressures (Taylor-Hood; Elman, Silvester and
Wathen, Finite Elements and Fast Iterative Solvers, 2014, section 3.3). A quarter of the pad is the image of a square
(Coons' patch: the middle of an arc is the image of a corner); on a crowned pad, heights follow the local thickness.
Every load is the sum of four parts, each even or odd across each of the two middle planes. Sideways loads are along the
projections of the axes x and y on the top.

On a crowned top, the wide layer is laid over the plan. Lengths along a slope are longer there than in the plan, so
loads in W are scaled by the power 3/4 of the ratio of areas: then the singular parts of F and W agree when averaged
over all directions.
"""

from __future__ import annotations

import hashlib
import itertools
import sys
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import BSpline
from scipy.linalg import pinvh
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu
from threadpoolctl import threadpool_limits

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.shape.cavity import Plan
from optopad.design.shape.outline import Box, Kind, Outline, outline_in
from optopad.design.shape.top import Top
from optopad.sims.cache import light_store, source_fingerprint

MARGIN = 3.0
"""Margin of the periodic domain around the pad [thicknesses]; the response decays as exp(-2 r / h)."""
PARITIES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Symmetry of a field across the middle plane of x and of y: 1 is even, -1 is odd."""


def wide_compliance(q: FloatArray, thickness: float) -> FloatArray:
    """Displacement over pressure (...) of a wide layer at wave numbers q (...) [1/mm], for a shear modulus of 1."""
    q = np.asarray(q, np.float64)
    k = np.minimum(q * thickness, 40.0)
    share = np.tanh(k) - k / np.cosh(k) ** 2
    share /= 1.0 + (k / np.cosh(k)) ** 2
    return np.asarray(np.divide(share, 2.0 * q, out=np.zeros_like(q), where=q > 0.0))


def wide_compliances(qx: FloatArray, qy: FloatArray, thickness: float) -> NDArray[np.complex128]:
    """Displacements over loads (3, 3, ...) of a wide layer at wave numbers qx, qy (...) [1/mm]; see the module."""
    q = np.hypot(qx, qy)
    k = np.minimum(q * thickness, 40.0)
    over = np.divide(1.0, q, out=np.zeros_like(q), where=q > 0.0)
    x, y, sharp = qx * over, qy * over, k / np.cosh(k)
    along = np.where(q > 0.0, (np.tanh(k) + sharp / np.cosh(k)) / (1.0 + sharp**2) * 0.5 * over, thickness)
    across = np.where(q > 0.0, np.tanh(k) * over, thickness)
    turned = 1j * sharp**2 / (1.0 + sharp**2) * 0.5 * over
    found = np.zeros((3, 3, *q.shape), np.complex128)
    found[0, 0], found[1, 1] = across + (along - across) * x**2, across + (along - across) * y**2
    found[0, 1] = found[1, 0] = (along - across) * x * y
    found[2, 0], found[2, 1] = turned * x, turned * y
    found[0, 2], found[1, 2] = -turned * x, -turned * y
    found[2, 2] = wide_compliance(q, thickness)
    return found


class WideLayer:
    """Response of a layer without walls on a grid of equally spaced nodes, by Fourier transforms."""

    def __init__(self, thickness: float, steps: tuple[float, float], shape: tuple[int, int]) -> None:
        """Prepare a grid of `shape` nodes, `steps` apart along x and y [mm]."""
        self._size = tuple(
            fft.next_fast_len(n + int(MARGIN * thickness / step), real=True)
            for n, step in zip(shape, steps, strict=True)
        )
        qx = 2.0 * np.pi * fft.fftfreq(self._size[0], steps[0])
        qy = 2.0 * np.pi * fft.rfftfreq(self._size[1], steps[1])
        self._waves, self._thickness = np.meshgrid(qx, qy, indexing="ij"), thickness
        self._compliance = wide_compliance(np.hypot(*self._waves), thickness)

    @cached_property
    def _compliances(self) -> NDArray[np.complex128]:
        qx, qy = self._waves
        return wide_compliances(qx, qy, self._thickness)

    def waves_of(self, loads: FloatArray) -> FloatArray:
        """Real and imaginary parts (2, load, wave) of Fourier transforms of loads (load, nx, ny).

        They are scaled so that those of x and -x together count once.
        """
        waves = fft.rfft2(loads, s=self._size, workers=2)
        twice = np.full(waves.shape[-1], 2.0)
        twice[0] = 1.0
        if self._size[1] % 2 == 0:
            twice[-1] = 1.0
        waves = (waves * np.sqrt(twice / np.prod(self._size))).reshape(len(loads), -1)
        return np.stack([waves.real, waves.imag])

    def work(self, waves: FloatArray, i: int, j: int) -> FloatArray:
        """Work (load, load) of one load's component i in the motion by another's component j, by Parseval's theorem."""
        real, imaginary = waves
        kernel = self._compliances[i, j].ravel()
        if kernel.imag.any():  # pressure and sideways motion
            half = (imaginary * kernel.imag) @ real.T
            return np.asarray(half - half.T)
        return np.asarray((real * kernel.real) @ real.T + (imaginary * kernel.real) @ imaginary.T)

    def moved(self, pressure: FloatArray) -> FloatArray:
        """Downward displacement (..., nx, ny) of the nodes under a pressure (..., nx, ny)."""
        waves = fft.rfft2(pressure, s=self._size, workers=2)
        waves *= self._compliance
        found = fft.irfft2(waves, s=self._size, workers=2, overwrite_x=True)
        return np.asarray(found[..., : pressure.shape[-2], : pressure.shape[-1]])

    def moved_by(self, load: FloatArray) -> FloatArray:
        """Displacement (3, nx, ny) of the nodes under a load (3, nx, ny)."""
        waves = fft.rfft2(load, s=self._size, workers=2)
        found = fft.irfft2(np.einsum("ijxy,jxy->ixy", self._compliances, waves), s=self._size, workers=2)
        return np.asarray(found[..., : load.shape[-2], : load.shape[-1]])

    def within(self, shape: tuple[int, int], sideways: bool = False) -> WideLayer:
        """The same response among the nodes of a smaller grid, at less cost; that to sideways loads only if asked."""
        small = object.__new__(WideLayer)
        small._size = tuple(
            min(fft.next_fast_len(2 * n, real=True), size) for n, size in zip(shape, self._size, strict=True)
        )

        def cut(waves: NDArray[Any]) -> NDArray[np.complex128]:
            kernel = fft.irfft2(waves, s=self._size)
            for axis, size in enumerate(small._size):
                kernel = kernel.take(np.fft.fftfreq(size, 1.0 / size).astype(np.int64), axis=axis - 2)
            return np.asarray(fft.rfft2(kernel))

        if sideways:
            small._compliances = cut(self._compliances)
        small._compliance = cut(self._compliance).real
        return small


Knots = tuple[FloatArray, FloatArray]
LEAST_NORMAL = 0.1
ELEMENT, MOST_ELEMENTS = 0.2, 10
"""Side of an element over the thickness [-], and largest number of elements along an axis of the quarter."""
SPLINE = 1.65
"""Spacing of the B-splines' knots over the side of an element [-]; narrower loads would not be resolved."""
GRID = 8
"""Nodes per interval of the grid on which the wide layer's W is computed."""
HEIGHTS = 1.0 - np.linspace(1.0, 0.0, 4) ** 2
"""Heights of the element boundaries over the local thickness [-], closer together towards the top."""
LEAST_MASS = 1e-5
"""Splines with less than this share of the largest one's mass inside the outline are left out."""


@dataclass(frozen=True, eq=False)
class PadLayer:
    """The change S of a wide layer's response by a pad's own walls, outline and crown.

    Attributes
    ----------
    thickness : thickness of the wide layer, the elastic thickness at the pad's highest point [mm]
    knots : for x and y, knots of the cubic B-splines [mm]
    coefficients : (spline, spline) the matrix C of downward motion by pressure, or (3 spline, 3 spline) that of all
        components' motion by all components' loads; the index of y runs fastest, that of the component slowest
    """

    thickness: float
    knots: tuple[FloatArray, FloatArray]
    coefficients: FloatArray

    def at(self, x_mm: FloatArray, y_mm: FloatArray) -> csr_matrix:
        """Values (n, spline) of the splines at places (n,) in the plan, in cavity coordinates [mm]."""
        one, other = (_splines(knots, at) for knots, at in zip(self.knots, (x_mm, y_mm), strict=True))
        n, each = len(one.indices) // 4, 4
        column = one.indices.reshape(n, each, 1) * other.shape[1] + other.indices.reshape(n, 1, each)
        value = one.data.reshape(n, each, 1) * other.data.reshape(n, 1, each)
        shape = n, one.shape[1] * other.shape[1]
        return csr_matrix((value.ravel(), column.ravel(), np.arange(n + 1) * each**2), shape=shape)


def _splines(knots: FloatArray, at: FloatArray) -> csr_matrix:
    low, high = knots[3], knots[-4]
    return csr_matrix(BSpline.design_matrix(np.clip(at, low, high), knots, 3))


PRESSURE, ALL = (2,), (0, 1, 2)
"""Components of load and motion: downward alone, or along x and y, too."""


def pad_layer(plan: Plan, black_mm: float, sideways: bool = False) -> PadLayer:
    """The response of a pad; it takes seconds, then it is kept, also in the store of traced light.

    Parameters
    ----------
    plan : outline and top of the pad
    black_mm : thickness of the black layer, which deforms with the clear one
    sideways : whether with loads and motions along x and y, which takes three times as long
    """
    thickness = plan.top.clear_mm + black_mm
    return _found(plan.outline.kind, plan.outline.box_mm, plan.top, thickness, ALL if sideways else PRESSURE)


@lru_cache(maxsize=16)
def _found(kind: Kind, box_mm: Box, top: Top, thickness: float, components: tuple[int, ...]) -> PadLayer:
    outline = outline_in(kind, box_mm)
    sides = box_mm[2] - box_mm[0], box_mm[3] - box_mm[1]
    elements = [int(np.clip(np.ceil(side / 2 / (ELEMENT * thickness)), 4, MOST_ELEMENTS)) for side in sides]
    counts = [round(2 * count / SPLINE) for count in elements]
    x, y = (
        np.asarray(low + side / count * np.arange(-3, count + 4), np.float64)
        for low, side, count in zip(box_mm[:2], sides, counts, strict=True)
    )
    here = source_fingerprint([sys.modules[__name__]])
    name = hashlib.blake2b(
        repr((here, kind, box_mm, top, thickness, components)).encode(), digest_size=16
    ).digest()
    store, size = light_store(), (len(x) - 4) * (len(y) - 4)
    kept = store.read([name]).get(name) if store else None
    if kept is not None:
        return PadLayer(thickness, (x, y), np.frombuffer(kept).reshape(2 * [len(components) * size]))
    found = _coefficients(outline, top, thickness, (x, y), elements, components)
    if store:
        store.write({name: found.tobytes()})
    return PadLayer(thickness, (x, y), found)


def _coefficients(
    outline: Outline,
    top: Top,
    thickness: float,
    knots: Knots,
    elements: list[int],
    components: tuple[int, ...],
) -> FloatArray:
    """The matrix C of `PadLayer`."""
    wide, mass = _wide_part(outline, top, thickness, knots, components)
    pad = _Quarter(outline, top, thickness, elements).answer(knots, components)
    kept = np.ix_(*2 * [np.flatnonzero(np.diag(mass) > LEAST_MASS * np.diag(mass).max())])
    inverse = np.zeros_like(mass)
    inverse[kept] = pinvh(mass[kept])
    found = inverse @ (pad - wide) @ inverse
    found = found.transpose(0, 2, 1, 3).reshape(2 * [len(components) * len(mass)])
    return np.asarray(0.5 * (found + found.T))


def _wide_part(
    outline: Outline, top: Top, thickness: float, knots: Knots, components: tuple[int, ...]
) -> tuple[FloatArray, FloatArray]:
    """The matrices W (component, component, spline, spline) and M of the splines."""
    x0, y0, x1, y1 = outline.box_mm
    nodes = [GRID * (len(one) - 7) for one in knots]
    steps = (x1 - x0) / nodes[0], (y1 - y0) / nodes[1]
    axes: list[FloatArray] = [
        np.asarray(low + (np.arange(n) + 0.5) * step)
        for low, n, step in zip((x0, y0), nodes, steps, strict=True)
    ]
    x, y = np.meshgrid(*axes, indexing="ij")
    inside = np.clip(outline.gap_mm(x, y) / min(steps) + 0.5, 0.0, 1.0)
    stretch = 1.0 / np.maximum(top.normal(x, y)[..., 2], LEAST_NORMAL)
    shapes = [_splines(one, at).toarray() for one, at in zip(knots, axes, strict=True)]
    splines = np.einsum("xi,yj->ijxy", *shapes).reshape(-1, inside.size)
    area = steps[0] * steps[1]
    mass = area * (splines * (inside * stretch).ravel()) @ splines.T
    loads = (splines * (inside * stretch**0.75).ravel()).reshape(-1, *inside.shape)
    layer = WideLayer(thickness, steps, inside.shape)
    waves = layer.waves_of(loads)
    found = np.zeros((*2 * [len(components)], *mass.shape))
    for (a, i), (b, j) in itertools.combinations_with_replacement(enumerate(components), 2):
        found[a, b] = area * layer.work(waves, i, j)
        found[b, a] = found[a, b].T
    return found, mass


POINTS, WEIGHTS = np.polynomial.legendre.leggauss(3)
QUADRATIC = np.stack([0.5 * POINTS * (POINTS - 1.0), 1.0 - POINTS**2, 0.5 * POINTS * (POINTS + 1.0)], axis=1)
SLOPES = np.stack([POINTS - 0.5, -2.0 * POINTS, POINTS + 0.5], axis=1)
HATS = np.stack([0.5 * (1.0 - POINTS), 0.5 * (1.0 + POINTS)], axis=1)
"""Shape functions (point, function) along one axis of an element, at Gauss' points."""


class _Quarter:
    """Finite elements of the quarter of a pad at x, y above its middle; z is the height above the floor."""

    def __init__(self, outline: Outline, top: Top, thickness: float, counts: list[int]) -> None:
        self.centre = outline.centre_mm
        self.counts = (*counts, len(HEIGHTS) - 1)
        x, y = _mapped(outline, counts)
        z = np.interp(np.arange(2 * len(HEIGHTS) - 1) / 2.0, np.arange(len(HEIGHTS)), HEIGHTS)
        local = thickness - top.sag_mm(x + self.centre[0], y + self.centre[1])
        grids = np.broadcast_arrays(x[..., None], y[..., None], local[..., None] * z)
        self.places = np.stack([grid.ravel() for grid in grids], axis=1)
        number = np.arange(len(self.places)).reshape(grids[0].shape)
        self.of_element = _windows(number, 3)
        self.number = number
        self.pressures = np.arange(np.prod(np.array(self.counts) + 1)).reshape(np.array(self.counts) + 1)
        self.matrix = self._assembled(_windows(self.pressures, 2))

    def _assembled(self, of_pressure: IntArray) -> csr_matrix:
        size, (slopes, weights) = len(self.places), self._slopes()
        hats = np.einsum("ai,bj,ck->abcijk", HATS, HATS, HATS).reshape(27, 8)
        tensor = np.einsum("egai,egbj,eg->eijab", slopes, slopes, weights, optimize=True)
        trace = np.einsum("eiiab->eab", tensor)
        squeezed = -np.einsum("gc,egai,eg->eiac", hats, slopes, weights, optimize=True)
        rows, columns, values = list[IntArray](), list[IntArray](), list[FloatArray]()

        def put(row: IntArray, column: IntArray, value: FloatArray) -> None:
            for kept, one in zip(
                (rows, columns), np.broadcast_arrays(row[:, :, None], column[:, None, :]), strict=True
            ):
                kept.append(one.ravel())
            values.append(value.ravel())

        node = self.of_element
        for i, j in itertools.product(range(3), repeat=2):
            part = tensor[:, j, i]
            put(node + i * size, node + j * size, part + trace if i == j else part)
        for i in range(3):
            put(node + i * size, of_pressure + 3 * size, squeezed[:, i])
            put(of_pressure + 3 * size, node + i * size, squeezed[:, i].transpose(0, 2, 1))
        total = 3 * size + self.pressures.size
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return csr_matrix(coo_matrix(entries, shape=(total, total)))

    def _slopes(self) -> tuple[FloatArray, FloatArray]:
        """Gradients (element, point, function, axis) of the quadratic shape functions, and weights of the points."""
        names = [[SLOPES if k == axis else QUADRATIC for k in range(3)] for axis in range(3)]
        local = np.stack([np.einsum("ai,bj,ck->abcijk", *one).reshape(27, 27) for one in names], axis=-1)
        jacobian = np.einsum("gns,enx->egxs", local, self.places[self.of_element], optimize=True)
        weights = np.einsum("a,b,c->abc", WEIGHTS, WEIGHTS, WEIGHTS).ravel() * np.linalg.det(jacobian)
        return np.einsum("gns,egsx->egnx", local, np.linalg.inv(jacobian), optimize=True), weights

    def answer(self, knots: Knots, components: tuple[int, ...]) -> FloatArray:
        """The matrices F (component, component, spline, spline) of the splines in the whole pad."""
        forces, x, y = self._top()
        shapes = [_splines(one, at).toarray() for one, at in zip(knots, (x, y), strict=True)]
        total = np.zeros((*2 * [len(components)], *2 * [shapes[0].shape[1] * shapes[1].shape[1]]))
        for parity in PARITIES:
            loads, spreads = [], []
            for k in components:
                folded, spread = zip(
                    *(
                        _folding(one.shape[1], -even if axis == k else even)
                        for axis, (one, even) in enumerate(zip(shapes, parity, strict=True))
                    ),
                    strict=True,
                )
                one, other = (shape @ fold for shape, fold in zip(shapes, folded, strict=True))
                loads.append(forces[k] @ np.einsum("gi,gj->gij", one, other).reshape(len(x), -1))
                spreads.append(np.kron(*spread))
            moved = self._moved(parity, np.concatenate(loads, axis=1))
            ends = np.cumsum([one.shape[1] for one in loads])[:-1]
            for j, motion in enumerate(np.split(moved, ends, axis=1)):
                for i, load in enumerate(loads):
                    total[i, j] += spreads[i] @ (4.0 * load.T @ motion) @ spreads[j].T
        return total

    def _top(self) -> tuple[list[csr_matrix], FloatArray, FloatArray]:
        """Nodal forces by unit loads along x, y and downward around each of Gauss' points on the top, and the points'
        cavity x and y."""
        node = _windows(self.number[:, :, -1], 3)
        shape = np.einsum("ai,bj->abij", QUADRATIC, QUADRATIC).reshape(9, 9)
        along = [
            np.einsum("ai,bj->abij", *one).reshape(9, 9) for one in ((SLOPES, QUADRATIC), (QUADRATIC, SLOPES))
        ]
        at = self.places[node]
        areas = np.cross(*(np.einsum("gn,enx->egx", one, at) for one in along))
        areas *= np.outer(WEIGHTS, WEIGHTS).reshape(1, 9, 1)
        size = np.linalg.norm(areas, axis=-1, keepdims=True)
        normal = areas / size
        first = np.array([1.0, 0.0, 0.0]) - normal[..., :1] * normal
        first /= np.linalg.norm(first, axis=-1, keepdims=True)
        rows = node[:, None, :, None] + len(self.places) * np.arange(3)
        columns = np.arange(areas.shape[0] * 9).reshape(-1, 9, 1, 1)
        x, y, _ = np.einsum("gn,enx->xeg", shape, at).reshape(3, -1)
        found = []
        for direction in (first, np.cross(normal, first), -normal):
            values = np.einsum("gn,egx->egnx", shape, size * direction)
            entries = values.ravel(), tuple(one.ravel() for one in np.broadcast_arrays(rows, columns))
            found.append(csr_matrix(coo_matrix(entries, shape=(self.matrix.shape[0], len(x)))))
        return found, x + self.centre[0], y + self.centre[1]

    def _moved(self, parity: tuple[int, int], load: FloatArray) -> FloatArray:
        """Displacements and pressures under loads (unknown, load) of a symmetry."""
        held = np.zeros((3, *self.number.shape), dtype=np.bool_)
        held[:, :, :, 0] = held[:, -1] = held[:, :, -1] = True
        empty = np.zeros(self.pressures.shape, dtype=np.bool_)
        for axis, even in enumerate(parity):
            plane = (slice(None),) * axis + (0,)
            for k in range(3):
                if (k == axis) == (even == 1):
                    held[k][plane] = True
            if even == -1:
                empty[plane] = True
        free = np.flatnonzero(~np.concatenate([held.ravel(), empty.ravel()]))
        out = np.zeros_like(load)
        with threadpool_limits(1, user_api="blas"):
            out[free] = splu(
                self.matrix[free][:, free].tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                options={"SymmetricMode": True},
                diag_pivot_thresh=1e-3,
            ).solve(load[free])
        return out


def _windows(number: IntArray, width: int) -> IntArray:
    """Numbers (element, node) of the nodes of every element of a grid; elements share their borders."""
    found = np.lib.stride_tricks.sliding_window_view(number, (width,) * number.ndim)
    return found[(slice(None, None, width - 1),) * number.ndim].reshape(-1, width**number.ndim)


def _folding(count: int, even: int) -> tuple[FloatArray, FloatArray]:
    """Even or odd parts (spline, part) of splines that are mirror images, and the splines (spline, part) from them."""
    parts = (count + (even == 1)) // 2
    one = np.eye(count)[:, :parts]
    return 0.5 * (one + even * one[::-1]), np.where(one[::-1] > one, float(even), one)


def _mapped(outline: Outline, counts: list[int]) -> tuple[FloatArray, FloatArray]:
    """The nodes' x and y (nx, ny) from the pad's middle, in the quarter where both are positive: Coons' patch."""
    x0, y0, x1, y1 = outline.box_mm
    a, b = (x1 - x0) / 2, (y1 - y0) / 2
    r = min(a, b) if outline.arcs else 0.0
    s, t = (np.linspace(0.0, 1.0, 2 * count + 1) for count in counts)

    def side(straight: float, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Along a side from the middle plane to the corner or the middle of the arc: distances along and inward."""
        way = share * (straight + r * np.pi / 4)
        turn = np.maximum(way - straight, 0.0) / r if r else 0.0 * way
        return np.minimum(way, straight) + r * np.sin(turn), r * (1.0 - np.cos(turn))

    along_top, below = side(a - r, s)
    along_east, inward = side(b - r, t)
    s, t = s[:, None], t[None, :]
    tx, ty = along_top[:, None], b - below[:, None]
    ex, ey = a - inward[None, :], along_east[None, :]
    return t * tx + s * ex - s * t * tx[-1], t * ty + s * ey - s * t * ty[-1]
