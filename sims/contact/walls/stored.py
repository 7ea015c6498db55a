"""The shipped data of the wall correction and its interpolation; lengths in tip radii."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from sims.contact.scope import HALF_WIDTH
from sims.contact.walls.shape import ACROSS_COUNT, ALONG_COUNT, RIM_RADII

FloatArray = NDArray[np.float64]

DATA_FILE = Path(__file__).parent / "data" / "walls.npz"
"""The fitted runs."""


def _cardinal(nodes: FloatArray, start: str = "not-a-knot") -> CubicSpline:
    """Coordinate -> weights of the nodes in a cubic spline."""
    return CubicSpline(nodes, np.eye(nodes.size), bc_type=(start, "not-a-knot"))


@dataclass(frozen=True, kw_only=True)
class WallState:
    """The data at one layer and press depth; by wall distance where several walls are possible.

    Attributes
    ----------
    force_ratio : (distance,) force that a single wall adds over that of the centred press [-]
    coefficients : (distance, coefficient) splines of the height field
    contact_radius : radius of the contact of the centred press
    rim_radii, rim : (n,) curve of the centred press outside the contact
    couplings : (2, 2) of force and of height: coupling of two walls that meet, that face each other
    """

    force_ratio: FloatArray
    coefficients: FloatArray
    contact_radius: float
    rim_radii: FloatArray
    rim: FloatArray
    couplings: FloatArray

    @property
    def block_shape(self) -> tuple[int, int]:
        """Coefficients across and along a wall."""
        return ACROSS_COUNT, ALONG_COUNT


class WallData:
    """The shipped arrays with their splines."""

    def __init__(self, arrays: dict[str, FloatArray]) -> None:
        self.layers, self.distances = arrays["layers"], arrays["distances"]
        self.nearest = float(self.distances[0])
        self._contact, self._rim = arrays["contact_radius"], arrays["rim"].astype(np.float64)
        self._force = arrays["force_ratio"]
        flat = arrays["coefficients"].astype(np.float64)
        self._coefficients = flat.reshape(*flat.shape[:3], -1)
        self._couplings = arrays["couplings"]
        self.pair_distance = float(arrays["pair_distance"])
        share = np.arange(self._contact.shape[1] + 1) / self._contact.shape[1]
        self._by_layer = _cardinal(np.log(self.layers))
        self._by_pair_layer = _cardinal(np.log(arrays["pair_layers"]))
        self._pair_layers = float(arrays["pair_layers"][0]), float(arrays["pair_layers"][-1])
        self.farthest = float(self.distances[-1])
        self._stored = [*range(len(self.distances) - 1), len(self.distances)]
        nodes = np.insert(self.distances, -1, HALF_WIDTH)
        self._by_distance = _cardinal(1.0 / nodes[::-1], "clamped")
        self._by_depth = _cardinal(share, "clamped")
        self._by_root = _cardinal(np.sqrt(share))

    def distance_weights(self, wall: float) -> FloatArray:
        """(distance,) weights of the stored distances; all 0 at 16/3, where the correction is none."""
        return np.asarray(self._by_distance(1.0 / wall)[::-1][self._stored], dtype=np.float64)

    def at(self, layer: float, share: float) -> WallState:
        """The data at a layer depth and a share of the deepest press in it [-]."""
        by_layer, by_depth = self._by_layer(np.log(layer)), self._by_depth(share)[1:]
        by_root = self._by_root(np.sqrt(share))[1:]
        force = np.tensordot(by_layer, self._force, 1) @ by_root
        coefficients = np.tensordot(by_layer, self._coefficients, 1)
        return WallState(
            force_ratio=force,
            coefficients=np.einsum("k,jkc->jc", by_depth, coefficients),
            contact_radius=float(by_layer @ self._contact @ by_root),
            rim_radii=RIM_RADII,
            rim=by_depth @ np.tensordot(by_layer, self._rim, 1),
            couplings=np.tensordot(
                self._by_pair_layer(np.log(np.clip(layer, *self._pair_layers))), self._couplings, 1
            ),
        )


@cache
def wall_data() -> WallData:
    """The shipped data, read once a process."""
    with np.load(DATA_FILE, allow_pickle=False) as entry:
        return WallData({name: entry[name] for name in entry.files if name != "provenance"})
