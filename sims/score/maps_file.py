"""Results of a pad by location as an xarray data set with units and provenance: ``sims/maps.nc`` in a bundle.

``xarray.open_dataset("sims/maps.nc")`` opens the file. Bounds have the axes ``y``, ``x``, ``depth``. Readings have the
axes ``y``, ``x``, ``press_depth``, ``pair``, since they are traced at more depths. An infinite value means not
resolved, or not detected. NaN means outside the workspace of a disc.
"""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from optopad.design.spec import SensorDesign
from optopad.sims.bounds.observability import PadBounds, pair_names

if TYPE_CHECKING:
    from optopad.sims.score.result import ContinuityScore

VERSIONED = ("optopad", "numpy", "numba", "mujoco", "xarray")
"""Packages whose versions are recorded in the file."""


def provenance(design: SensorDesign, seed: int) -> dict[str, Any]:
    """Attributes that record the origin of a file: design, digest, seed, versions."""
    return {
        "design": design.name,
        "design_digest": design.digest,
        "seed": seed,
        "versions": " ".join(
            [f"python {platform.python_version()}", *(f"{name} {version(name)}" for name in VERSIONED)]
        ),
    }


def bounds_dataset(bounds: PadBounds) -> xr.Dataset:
    """Data set of the bounds, with volume shares of the voxels and summaries for the failure of each component."""
    axes = ("y", "x", "depth")
    dataset = xr.Dataset(
        {
            "location_bound": (axes, bounds.location_mm, _of("least standard deviation of the location")),
            "location_bound_error": (axes, bounds.location_error_mm, _of("its standard error by the light model")),
            "depth_bound": (axes, bounds.depth_bound_mm, _of("least standard deviation of depth, location unknown")),
            "depth_bound_error": (axes, bounds.depth_error_mm, _of("its standard error by the light model")),
            "depth_bound_place_known": (axes, bounds.depth_alone_mm, _of("least standard deviation of the depth")),
            "depth_bound_place_known_error": (axes, bounds.depth_alone_error_mm, _of("its standard error")),
            "volume_share": (axes, bounds.weight, _of("share of the workspace that a voxel represents", "1")),
        },
        coords={
            "y": ("y", list(bounds.y_mm), _of("location across")),
            "x": ("x", list(bounds.x_mm), _of("location along")),
            "depth": ("depth", list(bounds.depth_mm), _of("depth of the press") | {"positive": "into the pad"}),
        },
    )  # fmt: skip
    if bounds.losses:
        dataset = dataset.assign(_losses(bounds)).assign_coords(part=[loss.part for loss in bounds.losses])
    return dataset


def maps_dataset(design: SensorDesign, score: ContinuityScore) -> xr.Dataset:
    """All results of a score by location, as a data set with units.

    Raises
    ------
    ValueError : the score has no map, because it is out of the models' scope or was computed for the verdict only.
    """
    if score.pad_map is None or score.pad_signals is None or score.readout is None:
        raise ValueError("score: it has no map; score the design with verdict_only=False")
    dataset = _map_part(score)
    if score.bounds is not None:
        dataset = dataset.merge(bounds_dataset(score.bounds), join="exact")
        if score.bounds.detection is not None:
            dataset = dataset.assign(_detection(score.bounds))
        dataset.attrs["accuracies_of_bounds"] = ", ".join(score.bounds.accuracies)
    names = pair_names_of(design)
    dataset = dataset.assign_coords(pair=names)
    dataset.attrs |= {"title": "optopad maps of the pad", **provenance(design, score.seed)}
    dataset.attrs |= {
        "counts_per_flux": score.readout.counts_per_flux,
        "noise": f"variance = 1/12 + {design.value_noise_counts:g}^2 + ({design.noise.relative_noise:g} counts)^2",
    }
    return dataset


def pair_names_of(design: SensorDesign) -> list[str]:
    """Names of all pairs of a design in the order E1-R1, E1-R2, ..."""
    from optopad.design.shape.cavity import cavity_of

    return list(pair_names(cavity_of(design)))


def _map_part(score: ContinuityScore) -> xr.Dataset:
    pad_map, light, readout = score.pad_map, score.pad_signals, score.readout
    assert pad_map is not None
    assert light is not None
    assert readout is not None
    depth_mm = light.presses[: len(light.presses) // len(pad_map.places), 2]
    shape = (len(pad_map.places), len(depth_mm), -1)
    counts = pad_map.grid(readout.counts(light.flux).reshape(shape))
    error = pad_map.grid((light.standard_error * readout.gains).reshape(shape))
    axes = ("y", "x")
    margin = pad_map.grid([place.margin for place in pad_map.places])
    return xr.Dataset(
        {
            "counts": ((*axes, "press_depth", "pair"), counts, _of("reading at the common gain, clipped", "counts")),
            "counts_error": ((*axes, "press_depth", "pair"), error, _of("its error by the light model", "counts")),
            "deadband": (axes, pad_map.deadband_grid_mm().astype(np.float64), _of("summed deadband of the location")),
            "usable_depth": (axes, pad_map.usable_grid_mm(), _of("usable depth: depth is resolved down to it")),
            "margin": (axes, margin, _of("least distance of the frames of two depths 0.3 mm apart", "sigma")),
        },
        coords={
            "y": ("y", list(pad_map.y_mm), _of("location across")),
            "x": ("x", list(pad_map.x_mm), _of("location along")),
            "press_depth": ("press_depth", depth_mm, _of("depth of the press") | {"positive": "into the pad"}),
        },
    )  # fmt: skip


def _detection(bounds: PadBounds) -> dict[str, Any]:
    detection, axes = bounds.detection, ("y", "x")
    assert detection is not None
    return {
        "felt_depth": (axes, detection.depth_mm, _of("least depth at which a press is detected")),
        "felt_force": (
            axes,
            detection.force_n,
            _of("detection threshold: least load at which a press is detected", "N"),
        ),
        "felt_force_low": (axes, detection.low_n, _of("the same at the lower end of the modulus", "N")),
        "felt_force_high": (axes, detection.high_n, _of("the same at the upper end of the modulus", "N")),
        "felt_force_trace_low": (
            axes,
            detection.force_error_low_n,
            _of("the same, less the numerical error of the light model", "N"),
        ),
        "felt_force_trace_high": (
            axes,
            detection.force_error_high_n,
            _of("the same, plus the numerical error of the light model", "N"),
        ),
    }


def _losses(bounds: PadBounds) -> dict[str, Any]:
    losses = bounds.losses
    return {
        "coverage_without": (
            "part",
            [x.coverage.value for x in losses],
            _of("covered without the part", "1"),
        ),
        "location_without": (
            "part",
            [x.median_location_mm.value for x in losses],
            _of("median location bound"),
        ),
        "depth_without": ("part", [x.median_depth_mm.value for x in losses], _of("median depth bound")),
    }


def _of(long_name: str, units: str = "mm") -> dict[str, Any]:
    return {"units": units, "long_name": long_name}
