"""Radiant power of an LED from the intensity that its data sheet states.

Luminous intensity I_v [cd] weighs light by the sensitivity V of the eye. Light of one wavelength has the luminous
efficacy K = 683 lm/W V(lambda), so its radiant intensity on the axis is

    I_e = I_v / K                                       [W/sr]

V is the photopic function of the CIE, linear in ln V between points every 5 nm (`design/data/photopic.toml`). An
intensity I_e cos^m(theta) that falls to one half at the half angle theta_h has the radiant power

    P = 2 pi int_0^(pi/2) I_e cos^m sin d(theta) = 2 pi I_e / (m + 1),      m = ln(1/2) / ln cos(theta_h)

The half angle is the one of the sheet, in air and with the lens: the lens changes directions, not the power.

Left out:

- The width of the spectrum, and the difference of dominant and peak wavelength. For three LEDs of a maker that states
  K for the whole spectrum (Broadcom ASMT-QTB4: 622, 530 and 470 nm; 210, 535 and 84 lm/W) the rule gives 16 % and 10 %
  too much, and 26 % too little.
- Light outside the main lobe. A narrow beam of a dome has side lobes, so its power is larger than that of cos^m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np

from optopad.design.errors import InputError
from optopad.design.fields.packaged import data_table
from optopad.design.fields.quantity import Quantity, lambertian_order

IntensityUnit = Literal["mcd", "mW/sr"]
MCD_PER_CD = 1000.0
MW_PER_W = 1000.0


@dataclass(frozen=True, kw_only=True)
class Intensity:
    """Intensity on the axis as a data sheet states it: luminous in mcd, or radiant in mW/sr."""

    value: float
    unit: IntensityUnit

    def __str__(self) -> str:
        return f"{self.value:g} {self.unit}"


def luminosity(wavelength_nm: float) -> float:
    """Photopic sensitivity V of the eye, relative to its largest value [-]; 0 outside the table's 420 to 700 nm."""
    at_nm, logs = _luminosity_table()
    if not at_nm[0] <= wavelength_nm <= at_nm[-1]:
        return 0.0
    return math.exp(float(np.interp(wavelength_nm, at_nm, logs)))


def efficacy_lm_per_w(wavelength_nm: float | None) -> Quantity:
    """Luminous efficacy of light of one wavelength, or of a white LED's light if it is None [lm/W].

    Raises
    ------
    InputError : V is below 0.004 at the wavelength, so that small errors of the spectrum dominate the conversion.
    """
    if wavelength_nm is None:
        return _quantity("white_efficacy")
    sensitivity = luminosity(wavelength_nm)
    if not sensitivity:
        low, high = (f"{end:g}" for end in _luminosity_table()[0][[0, -1]])
        raise InputError(
            f"--intensity: mcd at {wavelength_nm:g} nm is refused: the eye's sensitivity V is below 0.004 there, so it "
            f"does not measure the light; needs {low} to {high} nm; give the radiant intensity in mW/sr instead, "
            "as sheets of infrared and ultraviolet LEDs state it"
        )
    largest = _quantity("largest_efficacy")
    return Quantity(
        value=largest.value * sensitivity,
        unit="lm/W",
        source=f"683 lm/W x V = {sensitivity:.3g} at {wavelength_nm:g} nm",
        confidence="inferred",
    )


def radiant_intensity_mw_per_sr(intensity: Intensity, wavelength_nm: float | None) -> float:
    """Radiant intensity on the axis [mW/sr].

    Parameters
    ----------
    wavelength_nm : the LED's wavelength; None for white light; not used for an intensity in mW/sr

    Raises
    ------
    InputError : the intensity is in mcd, and the eye's sensitivity at the wavelength is too low to convert it.
    """
    if intensity.unit == "mW/sr":
        return intensity.value
    return MW_PER_W * intensity.value / MCD_PER_CD / efficacy_lm_per_w(wavelength_nm).value


def radiant_power_mw(intensity_mw_per_sr: float, half_angle_deg: float) -> float:
    """Radiant power [mW] of an intensity cos^m with this value on the axis and this half angle."""
    return 2.0 * math.pi * intensity_mw_per_sr / (lambertian_order(half_angle_deg) + 1.0)


def _quantity(name: str) -> Quantity:
    return Quantity(**data_table("photopic.toml")[name])


@cache
def _luminosity_table() -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [nm] and ln V at them, each (n,)."""
    table = data_table("photopic.toml")["luminosity"]
    return np.array(table["wavelength_nm"], dtype=float), np.log(table["v"])
