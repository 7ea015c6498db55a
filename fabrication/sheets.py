"""All sheets of a design, written into the bundle's folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design.io import write_text_atomically
from design.spec import SensorDesign
from fabrication.bom import bom_csv
from fabrication.casting import casting_md
from fabrication.driver_config import dump_driver_config
from fabrication.wiring import wiring_csv
from fabrication.wiring_svg import wiring_svg

FloatArray = NDArray[np.float64]


def sheet_texts(
    design: SensorDesign,
    counts_per_flux: float | None = None,
    untouched_counts: FloatArray | None = None,
) -> dict[str, str]:
    """Text of every sheet by file name.

    Parameters
    ----------
    counts_per_flux : the common gain that the simulation set [counts]; None leaves it out
    untouched_counts : (emitter, receiver) readings expected of the untouched pad [counts]; None leaves them out

    Raises
    ------
    DesignError : parts, pins or materials that the catalogue or the board does not have.
    """
    return {
        "driver.toml": dump_driver_config(design, counts_per_flux, untouched_counts),
        "wiring.csv": wiring_csv(design),
        "wiring.svg": wiring_svg(design),
        "bom.csv": bom_csv(design),
        "casting.md": casting_md(design),
    }


def write_sheets(
    design: SensorDesign,
    folder: Path,
    counts_per_flux: float | None = None,
    untouched_counts: FloatArray | None = None,
) -> dict[str, Path]:
    """Write every sheet into a folder that exists; the paths by file name.

    Raises
    ------
    DesignError : as `sheet_texts`; nothing is written.
    OutputError : the folder cannot be written.
    """
    texts = sheet_texts(design, counts_per_flux, untouched_counts)
    for name, text in texts.items():
        write_text_atomically(folder / name, text)
    return {name: folder / name for name in texts}
