"""The shipped library of solved presses: interpolates a press for any layer thickness and round pad in a millisecond.

An entry is a `SmoothPress`: cubic splines over depth, for one layer thickness in a round pad with its wall at
`WALL_RADIUS`, for tip radius 1 and Young's modulus 1. There is one entry for each thickness in `LAYERS`. All entries
use the same fractions of their deepest press, which is 0.8 of the layer thickness or 1.7 tip radii, whichever is less.
Between the entries, every spline coefficient is a cubic spline over 1/thickness. The deepest press has a kink where the
two limits meet (2.125 tip radii). So thin and thick layers have separate splines, which share the entry at the kink.

Other wall radii: their effect is solved at the thicknesses `WALL_LAYERS`, which are fewer, with each of `PAD_RADII`,
and added. The change of every coefficient is a cubic spline over 1/radius, zero at `WALL_RADIUS`. Between thicknesses
it is linear in 1/thickness for thin layers and a parabola for thick ones. Nothing is extrapolated outside the entries.

Crowns (spherical tops, pressed at the apex): their effect is added too. The change of every coefficient is a·crown +
b·crown², where crown is tip radius over crown radius. Surface heights are then above the undeformed top. Both factors
are solved for the pad `CROWN_CENTRE`, from two crowns, and its b is used for all pads. The slope a is also solved, from
the largest crown, for the other `CROWN_LAYERS` at the same wall radius and the other `CROWN_RADII` at the same layer
thickness. Another wall radius is assumed to change a by the same amount in every layer. The slope a is a parabola in
1/thickness and linear in 1/radius, and is extrapolated to the largest pad (contact-interpolation.md measures a press
there).

`tests/validation/contact/library_build.py` computes the file. docs/validation/contact.md describes the error of the
solver, contact-interpolation.md that of the interpolation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import resources

import numpy as np
from scipy.interpolate import CubicSpline

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.plain_arrays import plain_arrays
from optopad.design.rules.shape import (
    DEEPEST_PRESS,
    LARGEST_CROWN,
    LARGEST_REACH,
    LARGEST_SHARE_OF_LAYER,
    WALL_RADIUS_RANGE,
)
from optopad.sims.contact.library.smooth_press import VALUES, FitResidual, SmoothPress
from optopad.sims.contact.scope import HALF_WIDTH, WALL_RADIUS, require_rim, round_radius

FILE = "profiles.npz"
"""Name of the library file in the package's data folder."""
FORMAT = 3
"""Version of the library file's layout."""
MOST_BYTES = 50_000_000
"""Largest accepted size of the library file's unpacked arrays [bytes]; the shipped ones take 0.6 MB."""
CORNER = DEEPEST_PRESS / LARGEST_SHARE_OF_LAYER
"""Layer thickness at which the two limits of the press depth meet [tip radii]: 2.125."""
LAYERS = (1.3, 1.45, 1.63, 1.85, CORNER, 2.4, 2.7, 3.0, 3.5, 4.2, 5.0, 6.0)
"""Layer thicknesses in the library [tip radii], about evenly spaced in 1/thickness; 3.0 is the published pad's."""
WALL_LAYERS = (1.3, CORNER, 3.0, 6.0)
"""Layer thicknesses for which other wall radii are solved [tip radii]; each is also in `LAYERS`."""
PAD_RADII = (
    WALL_RADIUS_RANGE[0],
    *(round(round_radius(2.0 * half, 2.0 * half), 9) for half in (4.0, HALF_WIDTH)),
    WALL_RADIUS_RANGE[1],
)
"""Other wall radii that are solved [tip radii]: those of round pads with the areas of presets, and the largest."""
CROWN_LAYERS = (CORNER, 3.0, 6.0)
"""Layer thicknesses for which crowns (spherical tops) are solved [tip radii]; each is also in `LAYERS`."""
CROWN_RADII = (WALL_RADIUS_RANGE[0], WALL_RADIUS)
"""Wall radii for which crowns (spherical tops) are solved [tip radii]; flat pads are solved with them too."""
CROWN_CENTRE = (3.0, WALL_RADIUS)
"""Layer thickness and wall radius [tip radii]; every crowned pad that is solved has at least one of these values."""
_JOIN = 1e-9


def deepest_press(layer: float) -> float:
    """Deepest press in the library for a layer thickness; both in tip radii."""
    return min(LARGEST_SHARE_OF_LAYER * layer, DEEPEST_PRESS)


def require_crown(layer: float, wall_radius: float, crown: float) -> None:
    """Refuse a crown that the library does not cover.

    Parameters
    ----------
    layer, wall_radius : layer thickness at the apex, and wall radius [tip radii]
    crown : tip radius over the crown's radius [-]

    Raises
    ------
    InputError : the crown is not a finite number, or is negative
    ModelScopeError : the crown is too curved, the layer too thin or too thick, or the rim too steep or too thin
    """
    if not (math.isfinite(crown) and crown >= 0.0):
        raise InputError(f"crown: {crown:g} must be 0 (flat) or more")
    if crown == 0.0:
        return
    if crown > LARGEST_CROWN + _JOIN:
        raise ModelScopeError(
            f"crown: a radius of {1.0 / crown:.3f} tip radii, and the library has {1.0 / LARGEST_CROWN:g} or more; "
            "take a larger crown radius or a smaller tip"
        )
    low, high = CROWN_LAYERS[0], CROWN_LAYERS[-1]
    if not low - _JOIN <= layer <= high + _JOIN:
        raise ModelScopeError(
            f"layer: {layer:.3f} tip radii under a crown, and the library has {low:g} to {high:g}; "
            f"take {'a thicker layer or a smaller tip' if layer < low else 'a thinner layer or a larger tip'}"
        )
    reach = crown * wall_radius
    if reach > LARGEST_REACH + _JOIN:
        raise ModelScopeError(
            f"crown: the wall at {wall_radius:.3f} tip radii lies at {reach:.3f} of the crown's radius, and the "
            f"library has {LARGEST_REACH:g} at most; take a larger crown radius, a smaller pad, or, where the pad is "
            f"under {CROWN_RADII[0]:.2f} tip radii and taken for that, a smaller tip"
        )
    require_rim(layer, wall_radius, crown)


Chart = tuple[slice, CubicSpline]


def _charts(layers: FloatArray) -> tuple[Chart, Chart]:
    """Interpolation over layer thickness, for layers thinner and thicker than `CORNER`.

    Each is the slice of the library's entries that it uses, and splines for the weights of these entries."""
    corner = int(np.argmin(np.abs(layers - CORNER)))
    thin, thick = slice(0, corner + 1), slice(corner, len(layers))
    # abscissae of a spline must increase, so 1/layer is taken in reverse order
    return (
        (thin, CubicSpline(1.0 / layers[thin][::-1], np.eye(len(layers[thin]))[::-1])),
        (thick, CubicSpline(1.0 / layers[thick][::-1], np.eye(len(layers[thick]))[::-1])),
    )


@dataclass(frozen=True, kw_only=True)
class CrownChanges:
    """What a crown (spherical top) adds to the spline coefficients of a flat pad; lengths in tip radii.

    Attributes
    ----------
    layers : (layer,) increasing layer thicknesses
    radii : (pad,) increasing wall radii
    slopes : (layer, pad, coefficient, VALUES) factors of the crown, which is the tip's radius over the crown's
    bow : (coefficient, VALUES) factors of the square of the crown
    """

    layers: FloatArray
    radii: FloatArray
    slopes: FloatArray
    bow: FloatArray

    @cached_property
    def _charts(self) -> tuple[CubicSpline, CubicSpline]:
        """Splines for the weights of the `layers`, over 1/layer, and of the `radii`, over 1/radius."""
        layers, pads = (
            CubicSpline(1.0 / places[::-1], np.eye(len(places))[::-1]) for places in (self.layers, self.radii)
        )
        return layers, pads

    def at(self, layer: float, wall_radius: float, crown: float) -> FloatArray:
        """Change (coefficient, VALUES) that a crown makes to a flat pad's spline coefficients.

        Parameters
        ----------
        layer, wall_radius : layer thickness within the solved range, and wall radius [tip radii]
        crown : tip radius over the crown's radius [-]
        """
        of_layer, of_pad = self._charts
        pads = np.tensordot(of_layer(1.0 / layer), self.slopes, axes=1)
        slope = np.tensordot(of_pad(1.0 / wall_radius), pads, axes=1)
        return np.asarray(crown * slope + crown**2 * self.bow, dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Library:
    """Solved presses for several layer thicknesses ("entries"), as splines over depth; lengths in tip radii.

    Attributes
    ----------
    layers : (layer,) increasing layer thicknesses, `CORNER` among them
    first : (layer,) depth of the shallowest solved press
    wall_radius, mesh_size : radius of the entries' bonded wall, and node spacing under the tip in the mesh
    knots : (knot,) knots of the splines over ln(depth / deepest) [-]
    coefficients : (layer, coefficient, VALUES) spline coefficients of the numbers that describe a press
    wall_layers : (wall layer,) increasing layer thicknesses solved with other wall radii too, `CORNER` among them
    pad_radii : (pad,) increasing values of these other wall radii
    wall_changes : (wall layer, pad, coefficient, VALUES) coefficients for these other wall radii minus those of the
        entry
    crowned : how crowns change the coefficients
    residual : (layer, 6) residuals of the spline fits, in the order of `FitResidual`
    recipe : version of the solver that computed the library
    versions : names and versions of the programs that computed the library
    """

    layers: FloatArray
    first: FloatArray
    wall_radius: float
    mesh_size: float
    knots: FloatArray
    coefficients: FloatArray
    wall_layers: FloatArray
    pad_radii: FloatArray
    wall_changes: FloatArray
    crowned: CrownChanges
    residual: FloatArray
    recipe: int
    versions: tuple[str, ...]

    def covers(self, layer: float) -> bool:
        """Whether a layer thickness [tip radii] lies between the thinnest and the thickest entry."""
        return bool(self.layers[0] - _JOIN <= layer <= self.layers[-1] + _JOIN)

    @cached_property
    def _layer_charts(self) -> tuple[Chart, Chart]:
        return _charts(self.layers)

    @cached_property
    def _wall_charts(self) -> tuple[Chart, Chart]:
        return _charts(self.wall_layers)

    @cached_property
    def _pad_weights(self) -> CubicSpline:
        """Spline for the weights of the `pad_radii` over 1/radius; all are 0 at the entries' own wall radius."""
        before = int(np.searchsorted(self.pad_radii, self.wall_radius))
        radii = np.insert(self.pad_radii, before, self.wall_radius)
        weights = np.insert(np.eye(len(self.pad_radii)), before, 0.0, axis=0)
        return CubicSpline(1.0 / radii[::-1], weights[::-1])

    def press(self, layer: float, wall_radius: float | None = None, crown: float = 0.0) -> SmoothPress:
        """Interpolate the presses into a round pad.

        Parameters
        ----------
        layer : layer thickness that `covers` accepts [tip radii]; under a crown, the thickness at the apex
        wall_radius : radius of the bonded wall, clipped to the solved range [tip radii]; None is that of the entries
        crown : tip radius over the radius of a spherical top that is pressed at its apex; 0 is flat [-]

        Raises
        ------
        InputError, ModelScopeError : the crown is not covered, see `require_crown`
        """
        asked = self.wall_radius if wall_radius is None else wall_radius
        radius = float(np.clip(asked, self.pad_radii[0], self.pad_radii[-1]))
        require_crown(layer, max(asked, radius), crown)
        layer = float(np.clip(layer, self.layers[0], self.layers[-1]))
        part, weights = self._layer_charts[int(layer > CORNER)]
        share = weights(1.0 / layer)
        nearest = int(np.argmin(np.abs(self.layers - layer)))
        coefficients = np.tensordot(share, self.coefficients[part], axes=1) + self._change(layer, radius)
        if crown:
            coefficients = coefficients + self.crowned.at(layer, radius, crown)
        return SmoothPress(
            layer_depth=layer,
            wall_radius=radius,
            crown=crown,
            mesh_size=self.mesh_size,
            first=float(share @ self.first[part]),
            deepest=deepest_press(layer),
            knots=self.knots,
            coefficients=coefficients,
            residual=FitResidual.from_array(self.residual[nearest]),
            versions=self.versions,
        )

    def _change(self, layer: float, radius: float) -> FloatArray | float:
        """Change (coefficient, VALUES) of the coefficients due to another wall radius; 0 for the entries' own."""
        if radius == self.wall_radius:
            return 0.0
        part, weights = self._wall_charts[int(layer > CORNER)]
        pads = np.tensordot(weights(1.0 / layer), self.wall_changes[part], axes=1)
        return np.asarray(np.tensordot(self._pad_weights(1.0 / radius), pads, axes=1), dtype=np.float64)


@cache
def shipped_library() -> Library:
    """The library shipped with the package; its file is read only once."""
    with resources.as_file(resources.files("optopad.sims.contact.library").joinpath("data", FILE)) as file:
        held = plain_arrays(file, most_bytes=MOST_BYTES)
    if int(held["format"]) != FORMAT or held["coefficients"].shape[2] != VALUES:
        raise RuntimeError(f"{FILE} is not of this version of optopad; install optopad again")
    return Library(
        layers=held["layers"],
        first=held["first"],
        wall_radius=float(held["wall_radius"]),
        mesh_size=float(held["mesh_size"]),
        knots=held["knots"],
        coefficients=held["coefficients"].astype(np.float64),
        wall_layers=held["wall_layers"],
        pad_radii=held["pad_radii"],
        wall_changes=held["wall_changes"].astype(np.float64),
        crowned=CrownChanges(
            layers=held["crown_layers"],
            radii=held["crown_radii"],
            slopes=held["crown_slopes"].astype(np.float64),
            bow=held["crown_bow"].astype(np.float64),
        ),
        residual=held["residual"],
        recipe=int(held["recipe"]),
        versions=tuple(str(text) for text in held["versions"]),
    )
