"""Random numbers of the ray tracer: a random stream for each ray, and directions drawn from emission patterns.

Every ray has its own random stream (splitmix64; Steele, Lea & Flood 2014), started from a hash of seed, state, emitter
and ray number. So a ray does not depend on the number of threads or of requested rays.

A tabulated radiance L(c) is linear in the cosine c between the nodes c_i = i / (n - 1) and is drawn exactly. The share
of power up to c is 2 π ∫ c L dc, a cubic between nodes. It is inverted by Newton steps within a bracket.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from optopad.design.arrays import FloatArray


@njit()
def scramble(key: np.uint64) -> np.uint64:
    """Mix 64 bits so that neighbouring keys give unrelated numbers (the final step of splitmix64)."""
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))


@njit()
def ray_stream(seed: int, state: int, emitter: int, ray: int) -> np.uint64:
    """Initial state of one ray's random stream."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    key = scramble(np.uint64(seed) + golden)
    key = scramble((key ^ np.uint64(state)) + golden)
    key = scramble((key ^ np.uint64(emitter)) + golden)
    return scramble((key ^ np.uint64(ray)) + golden)


@njit()
def draw(stream: np.uint64) -> tuple[np.uint64, float]:
    """Advance a stream; return its new state and a random number in [0, 1)."""
    stream = stream + np.uint64(0x9E3779B97F4A7C15)
    return stream, float(scramble(stream) >> np.uint64(11)) * 2.0**-53


@njit()
def direction_about(nx: float, ny: float, nz: float, cosine: float, v: float) -> tuple[float, float, float]:
    """Unit direction with a given cosine to a unit normal, at the azimuth 2 π v; v in [0, 1)."""
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    if abs(nz) < 0.9:
        across = math.hypot(nx, ny)
        ax, ay, az = -ny / across, nx / across, 0.0
    else:
        across = math.hypot(ny, nz)
        ax, ay, az = 0.0, nz / across, -ny / across
    bx, by, bz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    p, q = sine * math.cos(2.0 * math.pi * v), sine * math.sin(2.0 * math.pi * v)
    return p * ax + q * bx + cosine * nx, p * ay + q * by + cosine * ny, p * az + q * bz + cosine * nz


@njit()
def lobe_direction(
    nx: float, ny: float, nz: float, order: float, u: float, v: float
) -> tuple[float, float, float]:
    """Random direction about a unit normal, for an intensity of cosᵐθ with m = `order`; u, v are random in [0, 1)."""
    return direction_about(nx, ny, nz, (1.0 - u) ** (1.0 / (order + 1.0)), v)


def pattern_shares(radiance: FloatArray) -> FloatArray:
    """Share of power below each node of radiance tables [-].

    Parameters
    ----------
    radiance : (e, n) radiance at the cosines linspace(0, 1, n), linear between them [1/sr]

    Returns
    -------
    (e, n) 2 π ∫ c L dc from 0 to each node; the last column is the power of a whole table
    """
    nodes = radiance.shape[1]
    cosine, width = np.linspace(0.0, 1.0, nodes), 1.0 / (nodes - 1)
    low, step = radiance[:, :-1], np.diff(radiance, axis=1)
    parts = cosine[:-1] * (low + step / 2.0) + width * (low / 2.0 + step / 3.0)
    shares = np.zeros_like(radiance)
    shares[:, 1:] = 2.0 * math.pi * width * np.cumsum(parts, axis=1)
    return shares


@njit()
def pattern_cosine(radiance: FloatArray, shares: FloatArray, u: float) -> float:
    """Random cosine, distributed like the power of one radiance table.

    radiance, shares : (n,) table [1/sr], and share of power below each node, from `pattern_shares` [-]
    u : random number in [0, 1)
    """
    last = radiance.shape[0] - 1
    width = 1.0 / last
    goal = u * shares[last]
    cell = min(max(np.searchsorted(shares, goal, side="right") - 1, 0), last - 1)
    cosine, low, step = cell * width, radiance[cell], radiance[cell + 1] - radiance[cell]
    one, two, three = cosine * low, (cosine * step + width * low) / 2.0, width * step / 3.0
    wanted = (goal - shares[cell]) / (2.0 * math.pi * width)
    left, right, t = 0.0, 1.0, 0.5
    for _ in range(60):
        excess = ((three * t + two) * t + one) * t - wanted
        if excess > 0.0:
            right = t
        else:
            left = t
        slope = (3.0 * three * t + 2.0 * two) * t + one
        guess = t - excess / slope if slope > 0.0 else 2.0
        if not left <= guess <= right:
            guess = 0.5 * (left + right)
        if abs(guess - t) < 1e-15:
            break
        t = guess
    return float(cosine + width * t)


@njit()
def table_value(table: FloatArray, cosine: float) -> float:
    """Interpolate linearly in a table (n,) over the cosines linspace(0, 1, n), at a cosine in [0, 1]."""
    last = table.shape[0] - 1
    place = min(max(cosine, 0.0), 1.0) * last
    node = min(int(place), last - 1)
    return float(table[node] + (place - node) * (table[node + 1] - table[node]))
