"""From light to counts: the receivers' transimpedance gains, then a converter that clips.

counts = gain x flux, with flux as a fraction of the emitted power. "Judged" pairs are the pairs that the verdict
considers. `gain.feedback_ohm` selects the rule for the gains:

    each     one gain per receiver: without contact, the median of its judged pairs reads `gain.target_counts`, or
             less, so that the brightest of them reads at most `HEADROOM` of full scale; the default
    common   one gain for all: the median judged pair reads the target without contact; brighter ones may clip
    ohms     the mounted resistors, with the emitters' power and the receivers' responsivity
             (`optopad.design.circuit.transimpedance`)

Left out: emitters of different power on one pad, ambient light and drift, which belong to the signal chain.

`signals_dataset` makes an xarray data set of signals with units and provenance, `save_dataset` a netCDF file of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.circuit.transimpedance import fitted_counts_per_flux
from optopad.design.draft import Draft
from optopad.design.errors import ModelScopeError
from optopad.design.files import whole_file
from optopad.design.shape.cavity import CavityGeometry
from optopad.design.spec import SensorDesign
from optopad.sims.optics.accuracy import LightSignals

if TYPE_CHECKING:
    import xarray as xr

HEADROOM = 0.75
"""Largest untouched reading of the brightest judged pair of each receiver, as a share of full scale [-]. It applies if
each receiver has its own gain. The rest of the range is for dimples, which on the published layouts mirror up to a
quarter more light onto the brightest pairs.
"""


@dataclass(frozen=True, kw_only=True)
class Readout:
    """Gains of the receivers, the converter's range, and the noise of a reading.

    Attributes
    ----------
    counts_per_flux : ADC counts if all of an emitter's power reached one receiver; the median over the receivers
        [counts]
    full_scale_counts : largest reading of the converter [counts]
    read_noise_counts : standard deviation of a reading in the dark, without rounding [counts]
    relative_noise : standard deviation of the light, divided by its mean [-]
    by_receiver : the same as `counts_per_flux` for each receiver, in order [counts]; empty if all have one common gain
    """

    counts_per_flux: float
    full_scale_counts: float
    read_noise_counts: float
    relative_noise: float
    by_receiver: tuple[float, ...] = ()

    @property
    def noise(self) -> dict[str, float]:
        """The noise of a reading, as keyword arguments for the functions of the verdict."""
        return {"read_noise_counts": self.read_noise_counts, "relative_noise": self.relative_noise}

    @property
    def gains(self) -> FloatArray:
        """Gains for flux whose last axis is the receiver [counts]: (receiver,), or () for one common gain."""
        return np.array(self.by_receiver or self.counts_per_flux)

    def of_receiver(self, receiver: int) -> float:
        """Gain of the receiver with this index [counts]."""
        return self.by_receiver[receiver] if self.by_receiver else self.counts_per_flux

    def of_each(self, receivers: int) -> tuple[float, ...]:
        """Gain of each receiver, for a pad with this number of receivers [counts]."""
        return self.by_receiver or (self.counts_per_flux,) * receivers

    def of_pairs(self, pairs: Sequence[tuple[int, int]]) -> FloatArray:
        """Gains (pair,) of pairs given as (emitter, receiver) indices [counts]."""
        return np.array([self.of_receiver(receiver) for _, receiver in pairs])

    def of_mask(self, mask: BoolArray) -> FloatArray:
        """Gains (pair,) of the pairs that a mask (emitter, receiver) selects, emitter by emitter [counts]."""
        return np.broadcast_to(self.gains, mask.shape)[mask]

    def of_all_pairs(self, count: int) -> FloatArray:
        """Gains (pair,) of all `count` pairs, in the order E1-R1, E1-R2, ... [counts]."""
        each = self.by_receiver or (self.counts_per_flux,)
        return np.tile(np.array(each), count // len(each))

    def counts(self, flux: FloatArray) -> FloatArray:
        """Readings of a flux array whose last axis is the receiver, clipped at full scale [counts]."""
        return np.minimum(flux * self.gains, self.full_scale_counts)


def readout_of(draft: Draft, untouched_flux: FloatArray, reference: BoolArray) -> Readout:
    """The gains of a design by its rule: from the light without contact, or from the mounted resistors.

    Parameters
    ----------
    untouched_flux : (emitter, receiver) flux without contact as a fraction of emitted power [-]
    reference : (emitter, receiver) mask of the pairs whose median reading is set to the target

    Raises
    ------
    ModelScopeError : the reference pairs receive no light, so no gain gives a signal.
    """
    design, full_scale = draft.design, draft.circuit.adc.full_scale_counts
    feedback = design.gain.feedback_ohm
    each: tuple[float, ...] = ()
    if feedback == "common":
        common = _gain_to_target(design, untouched_flux[reference], "the median judged pair receives")
    else:
        each = (
            _each(design, untouched_flux, reference, HEADROOM * full_scale)
            if feedback == "each"
            else fitted_counts_per_flux(draft.circuit)
        )
        common = float(np.median(each))
    return Readout(
        counts_per_flux=common,
        full_scale_counts=full_scale,
        read_noise_counts=design.value_noise_counts,
        relative_noise=design.noise.relative_noise,
        by_receiver=each,
    )


def _each(design: SensorDesign, flux: FloatArray, reference: BoolArray, most: float) -> tuple[float, ...]:
    """Gain of each receiver, from its pairs in the mask `reference`; if none are, from all pairs in the mask.

    `most` is the largest reading of a receiver's brightest pair [counts].
    """
    found = []
    for receiver in range(flux.shape[1]):
        own = np.zeros_like(reference)
        own[:, receiver] = reference[:, receiver]
        chosen = own if own.any() else reference
        wanted = _gain_to_target(design, flux[chosen], f"the median pair of R{receiver + 1} receives")
        found.append(min(wanted, most / float(flux[chosen].max())))
    return tuple(found)


def most_target_counts(draft: Draft, untouched_flux: FloatArray, reference: BoolArray) -> float:
    """Largest useful `gain.target_counts` [counts].

    With one gain for all receivers, the brightest pair clips above it. With a gain for each, all gains have reached the
    limit that keeps their brightest pairs from clipping.
    """
    full_scale = draft.circuit.adc.full_scale_counts
    if draft.design.gain.feedback_ohm == "common":
        chosen = [untouched_flux[reference]]
    else:
        full_scale *= HEADROOM
        chosen = [flux[own] for flux, own in zip(untouched_flux.T, reference.T, strict=True) if own.any()]
    shares = [float(np.median(flux) / flux.max()) for flux in chosen if flux.size and flux.max() > 0.0]
    return full_scale * max(shares, default=1.0)


def _gain_to_target(design: SensorDesign, flux: FloatArray, subject: str) -> float:
    median = float(np.median(flux)) if flux.size else 0.0
    if not median > 0.0:
        raise ModelScopeError(
            f"gain.target_counts: {subject} {median:.1e} of the emitted power; no gain makes that a "
            "signal: raise the emitters and receivers into the clear layer"
        )
    return design.gain.target_counts / median


COMPRESSION = {"zlib": True, "complevel": 4}


def signals_dataset(
    light: LightSignals, cavity: CavityGeometry, *, counts_per_flux: float | None = None
) -> xr.Dataset:
    """Turn traced light into an xarray data set with named axes and units.

    Parameters
    ----------
    counts_per_flux : the common gain, stored as an attribute so that counts can be computed from flux [counts]

    Returns
    -------
    data set with ``flux`` (state, emitter, receiver), ``flux_by_class`` (path, state, emitter, receiver),
    ``standard_error`` (state, emitter, receiver), and ``press_x``, ``press_y``, ``press_depth`` (state) [mm]. A state
    is one traced press
    """
    import xarray as xr  # which takes a third of a second to import, and a verdict does not need it

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
    """Write a data set as netCDF, completely or not at all; raises the errors of `optopad.design.files.whole_file`."""
    encoding = {name: COMPRESSION for name, values in dataset.data_vars.items() if values.ndim > 1}
    with whole_file(file) as hidden:
        dataset.to_netcdf(hidden, engine="h5netcdf", encoding=encoding)
