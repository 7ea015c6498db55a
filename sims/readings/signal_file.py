"""Signals as an xarray data set with units and provenance, and as a netCDF file.

Open one with a line: ``xarray.open_dataset("sims/signals.nc")``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from design.shape.cavity import CavityGeometry
from design.whole_file import whole_file
from sims.optics.light_signals import LightSignals

COMPRESSION = {"zlib": True, "complevel": 4}


def signals_dataset(
    light: LightSignals, cavity: CavityGeometry, *, counts_per_flux: float | None = None
) -> xr.Dataset:
    """Name the axes of a trace.

    Parameters
    ----------
    counts_per_flux : the common gain, recorded so that counts follow from flux [counts]

    Returns
    -------
    data set with ``flux`` (state, emitter, receiver), ``flux_by_class`` (path, state, emitter, receiver),
    ``standard_error``, and the press of every state [mm]
    """
    axes = ("state", "emitter", "receiver")
    names = list(light.by_class)
    share = {"units": "1", "long_name": "flux over the emitter's power"}
    dataset = xr.Dataset(
        {
            "flux": (axes, light.flux, share),
            "flux_by_class": (("path", *axes), np.stack([light.by_class[name] for name in names]), share),
            "standard_error": (axes, light.standard_error, share | {"long_name": "standard error of flux"}),
            "press_x": ("state", light.presses[:, 0], {"units": "mm"}),
            "press_y": ("state", light.presses[:, 1], {"units": "mm"}),
            "press_depth": ("state", light.presses[:, 2], {"units": "mm", "positive": "into the pad"}),
        },
        coords={
            "path": names,
            "emitter": [part.name for part in cavity.emitters],
            "receiver": [part.name for part in cavity.receivers],
        },
        attrs={"title": "optopad light signals", "design_digest": light.digest, "seed": light.seed},
    )
    if counts_per_flux is not None:
        dataset.attrs["counts_per_flux"] = counts_per_flux
    return dataset


def save_dataset(dataset: xr.Dataset, file: Path) -> None:
    """Write a data set as netCDF, whole or not at all; raises as `design.whole_file.whole_file`."""
    encoding = {name: COMPRESSION for name, values in dataset.data_vars.items() if values.ndim > 1}
    with whole_file(file) as hidden:
        dataset.to_netcdf(hidden, engine="h5netcdf", encoding=encoding)
