"""How far interpolated press curves are from traced light, by scheme and number of depths.

    python -m tests.validation.learning.press_curve_table    # 900 states, two core-minutes

Its table is in docs/how-to/simulate-data-set.md.

Six places of the paper's pad are traced at 73 depths, at "draft" and at "standard". Curves through some of these depths
are held against all others, in counts of the design's gain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from optopad.design.arrays import FloatArray
from optopad.design.preset import preset
from optopad.sims.readings.press_data import COARSE_KNOTS_MM, KNOTS_MM, PressCurves, traced_curves
from optopad.sims.readings.protocol import untouched_readout

PLACES_MM = np.array([[16.5, 19.1], [6.4, 18.3], [10.9, 6.2], [8.0, 8.0], [20.3, 12.7], [25.1, 24.2]])
"""Those of the paper's depth plots, and three more."""
DEPTHS_MM = np.unique(
    np.round(
        np.concatenate(
            [np.arange(0, 0.3, 0.02), np.arange(0.3, 1.2, 0.05), np.arange(1.2, 5.05, 0.1), [5.1]]
        ),
        4,
    )
)
SCHEMES = {
    "makima": None,
    "pchip": PchipInterpolator,
    "cubic spline": CubicSpline,
}


@dataclass(frozen=True)
class Row:
    """Errors of one scheme [counts]."""

    accuracy: str
    depths: int
    scheme: str
    rms: float
    near_contact: float
    worst: float


def dense_counts(accuracy: str) -> FloatArray:
    """(place, depth, emitter, receiver) of the paper's pad [counts]."""
    design = preset("piacenza2017-pad")
    curves = traced_curves(design, PLACES_MM, depth_mm=DEPTHS_MM, accuracy=accuracy)
    return np.asarray(curves.flux * untouched_readout(design, curves.untouched).counts_per_flux)


def rows_of(counts: FloatArray, accuracy: str) -> list[Row]:
    """All schemes and knots against one accuracy."""
    return [
        row_of(counts, accuracy, np.array(knots), scheme)
        for knots in (KNOTS_MM, COARSE_KNOTS_MM)
        for scheme in SCHEMES
    ]


def row_of(counts: FloatArray, accuracy: str, knots_mm: FloatArray, scheme: str) -> Row:
    """One scheme through some of the depths, held against the others."""
    at = np.searchsorted(DEPTHS_MM, knots_mm - 1e-6)
    rest = np.setdiff1d(np.arange(len(DEPTHS_MM)), at)
    found = _between(counts[:, at], knots_mm, DEPTHS_MM[rest], scheme)
    error = found - counts[:, rest]
    near = DEPTHS_MM[rest] < 1.0
    return Row(
        accuracy=accuracy,
        depths=len(knots_mm),
        scheme=scheme,
        rms=float(np.sqrt((error**2).mean())),
        near_contact=float(np.sqrt((error[:, near] ** 2).mean())),
        worst=float(np.abs(error).max()),
    )


def _between(counts: FloatArray, knots_mm: FloatArray, depth_mm: FloatArray, scheme: str) -> FloatArray:
    chosen = SCHEMES[scheme]
    if chosen is not None:
        return np.asarray(chosen(np.sqrt(knots_mm), counts, axis=1)(np.sqrt(depth_mm)))
    curves = PressCurves(places_mm=PLACES_MM, depth_mm=knots_mm, flux=counts)
    number = np.repeat(np.arange(len(PLACES_MM)), len(depth_mm))
    found = curves.at(number, np.tile(depth_mm, len(PLACES_MM)))
    return found.reshape(len(PLACES_MM), len(depth_mm), *counts.shape[2:])


def main() -> None:
    """Print the table."""
    print("| light | depths | scheme | rms | below 1 mm | worst |\n|---|---|---|---|---|---|")
    traced = {accuracy: dense_counts(accuracy) for accuracy in ("draft", "standard")}
    for accuracy, counts in traced.items():
        for row in rows_of(counts, accuracy):
            print(
                f"| {row.accuracy} | {row.depths} | {row.scheme} | {row.rms:.2f} | {row.near_contact:.2f} "
                f"| {row.worst:.0f} |"
            )
    fits = traced["standard"][0, 0] < 1023.0
    apart = (traced["draft"] - traced["standard"])[:, :, fits]
    print(f"\ndraft from standard, pairs that do not clip: {np.sqrt((apart**2).mean()):.2f} counts rms")


if __name__ == "__main__":
    main()
