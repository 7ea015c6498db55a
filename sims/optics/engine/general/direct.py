# mypy: no-warn-return-any
"""Direct light between the faces (windows) of an emitter and a receiver in a disc or crowned pad, by quadrature.

    flux = ∫∫ L(c_e) c_e c_r e^(-μ s) A(c_r) / s² dA_e dA_r

The integral is over both faces. L is the emitter's radiance divided by its power per area; A is the share of light that
the receiver counts. In plan the pad and its crown are convex, so only the tip and its dimple can come between two
faces. A column of the receiver is lit from its lower end up to a horizon, or a leaning one from its upper end down; the
horizon is found by halving an interval. Gauss' rule covers the lit part.

A column that is lit in two separate parts is not modelled.
"""

from __future__ import annotations

import math

from optopad.design.arrays import FloatArray
from optopad.sims.optics.engine.general.rays import (
    AREA,
    HALF_U,
    HALF_V,
    INSIDE,
    NZ,
    WALL,
    lobe,
    onto,
    sees,
    window_point,
)
from optopad.sims.optics.engine.general.top import OUTER, FormedTop
from optopad.sims.optics.surface.radial import kernel

HALVINGS = 12


@kernel
def straight_flux(
    e: FloatArray, r: FloatArray, absorbs: float, top: FormedTop, nodes_e: FloatArray,
    weights_e: FloatArray, nodes_u: FloatArray, weights_u: FloatArray, nodes_v: FloatArray, weights_v: FloatArray,
) -> float:  # fmt: skip
    """Direct light of a pair, as a share of the emitter's power.

    Parameters
    ----------
    e, r : rows of the emitter's and the receiver's face (`lower.windows_of`)
    absorbs : absorption coefficient [1/mm]
    top : the pressed top
    nodes_e, nodes_u, nodes_v : Gauss nodes from -1 to 1 over each direction of the emitter, the receiver's columns, and
        the height of a column
    weights_e, weights_u, weights_v : weights of these nodes
    """
    if e[WALL] == r[WALL] and e[WALL] > INSIDE:
        return 0.0
    total = 0.0
    for a in range(nodes_e.shape[0]):
        for b in range(nodes_e.shape[0]):
            x, y, z = window_point(e, nodes_e[a], nodes_e[b])
            share = weights_e[a] * weights_e[b]
            for c in range(nodes_u.shape[0]):
                low, high = -1.0, 1.0
                if top.numbers[OUTER] > 0.0:
                    tx, ty, tz = window_point(r, nodes_u[c], 1.0)
                    if not sees(x, y, z, tx, ty, tz, top):
                        high = _horizon(x, y, z, r, nodes_u[c], -1.0, top)
                    elif r[NZ] != 0.0:  # the face leans, so either end may be the shaded one
                        tx, ty, tz = window_point(r, nodes_u[c], -1.0)
                        if not sees(x, y, z, tx, ty, tz, top):
                            low = _horizon(x, y, z, r, nodes_u[c], 1.0, top)
                half = 0.5 * (high - low)
                if half <= 0.0:
                    continue
                column = 0.0
                for k in range(nodes_v.shape[0]):
                    tx, ty, tz = window_point(r, nodes_u[c], low + half * (nodes_v[k] + 1.0))
                    dx, dy, dz = tx - x, ty - y, tz - z
                    s2 = dx * dx + dy * dy + dz * dz
                    s = math.sqrt(s2)
                    out = -onto(e, dx, dy, dz) / s
                    into = onto(r, dx, dy, dz) / s
                    if out > 0.0 and into > 0.0:
                        column += (
                            weights_v[k]
                            * lobe(e, out)
                            * out
                            * into
                            * math.pi
                            * lobe(r, into)
                            * math.exp(-absorbs * s)
                            / s2
                        )
                total += share * weights_u[c] * half * column
    return total * e[HALF_U] * e[HALF_V] / e[AREA] * r[HALF_U] * r[HALF_V]


@kernel
def _horizon(x: float, y: float, z: float, r: FloatArray, u: float, end: float, top: FormedTop) -> float:
    """Where the part of a receiver's column ends that sees a point, in half heights from its middle.

    end : the end, -1 or 1, from which the column is seen; it is returned if not even this end sees the point
    """
    tx, ty, tz = window_point(r, u, end)
    if not sees(x, y, z, tx, ty, tz, top):
        return end
    seen, dark = end, -end
    for _ in range(HALVINGS):
        middle = 0.5 * (seen + dark)
        tx, ty, tz = window_point(r, u, middle)
        if sees(x, y, z, tx, ty, tz, top):
            seen = middle
        else:
            dark = middle
    return 0.5 * (seen + dark)
