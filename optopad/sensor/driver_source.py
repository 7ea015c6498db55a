"""Which driver configuration a word on the command line means, and the simulated light that goes with it.

A `driver.toml` is taken as it is; a bundle's folder gives the one in it; a design or preset gives that of its bundle
in `outputs`, or, where it has none yet, one made here, in memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from design.errors import DesignError, InputError
from design.io import read_design_text
from design.progress import OnStep
from design.spec import SensorDesign
from design.toml_text import parsed_toml
from fabrication.driver.simulated.press_table import PressTable, table_from_signals, table_of, untouched_table
from fabrication.driver_file import DriverConfig, load_driver_config

if TYPE_CHECKING:
    from fabrication.gain import SimulatedGain
    from sims.learning.inference.touch_model import TouchModel


TABLE_DEPTHS_MM = (0.0, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
"""Depths of a table that is simulated for the fake board; those beyond the design's are left out, its end is added."""

TABLE_ACCURACY = "draft"


@dataclass(frozen=True, kw_only=True)
class DriverSource:
    """A configuration, the design it was made from where that is known, and the bundle it lies in."""

    config: DriverConfig
    design: SensorDesign | None
    bundle: Path | None


def driver_source(where: str, changes: list[str] | None, out: Path) -> DriverSource:
    """What a word on the command line means.

    Parameters
    ----------
    where : driver.toml, bundle folder, design file or preset
    changes : `--set` of a design
    out : folder that holds the bundles

    Raises
    ------
    InputError, DesignError : nothing of the kind, or damaged; `--set` of what is no design.
    """
    path = Path(where)
    file = path / "fabrication" / "driver.toml" if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        file = path / "driver.toml"
    if path.is_dir() or _is_driver_file(file):
        if changes:
            raise InputError(f"--set: {where} is written already; name the design and change that")
        return DriverSource(config=load_driver_config(file), design=None, bundle=_bundle_of(file))
    from optopad.work.designs import read_design

    return source_of(read_design(where, changes), out)


def with_expected_pattern(source: DriverSource, *, seed: int, on_step: OnStep) -> DriverConfig:
    """The configuration with what the untouched pad should read, simulated here where it is not there yet.

    Raises
    ------
    InputError : it has none, and the design that could be simulated is not known.
    """
    if source.config.expected is not None:
        return source.config
    if source.design is None:
        untouched_table(source.config)  # says what to do
    assert source.design is not None
    return _config(source.design, simulated_gain(source.design, seed=seed, on_step=on_step))


def press_table(source: DriverSource, *, seed: int, on_step: OnStep) -> tuple[DriverConfig, PressTable]:
    """Readings under presses: of the bundle's signals, else simulated at draft, else only the untouched pad."""
    if source.bundle is not None and source.config.gain.counts_per_flux is not None:
        signals = source.bundle / "sims" / "signals.nc"
        if signals.is_file():
            return source.config, table_from_signals(signals, source.config)
    if source.design is None:
        return source.config, untouched_table(source.config)
    gain = simulated_gain(source.design, seed=seed, on_step=on_step)
    return _config(source.design, gain), _simulated_table(source.design, gain, seed=seed, on_step=on_step)


def simulated_gain(design: SensorDesign, *, seed: int, on_step: OnStep) -> SimulatedGain:
    """Gains, and light of the untouched pad, as a score sets them."""
    from design.shape.cavity import cavity_of
    from design.shape.pairs import judged_pairs, mask_of
    from fabrication.gain import SimulatedGain
    from sims.readings.readout import readout_of
    from sims.verdict.presses import untouched_flux

    cavity = cavity_of(design)
    flux = untouched_flux(design, cavity, seed=seed)
    readout = readout_of(design, flux, mask_of(judged_pairs(cavity), cavity))
    on_step("light", 0.0)
    return SimulatedGain(
        counts_per_flux=readout.of_each(flux.shape[1]), untouched_flux=tuple(map(tuple, flux.tolist()))
    )


def _simulated_table(design: SensorDesign, gain: SimulatedGain, *, seed: int, on_step: OnStep) -> PressTable:
    import numpy as np

    from design.shape.cavity import cavity_of
    from sims.contact.indentation import solved_press
    from sims.optics.tracing import trace
    from sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm
    from sims.verdict.presses import states_of

    cavity, deepest = cavity_of(design), design.operating.max_depth_mm
    depths = np.array(sorted({*(depth for depth in TABLE_DEPTHS_MM if depth < deepest), deepest}))
    places = grid_places_mm(cavity.workspace, *map_grid_mm(cavity, COARSE_PLACES))
    states = states_of(places, depths)
    solved_press(design, max_depth_mm=deepest, on_step=lambda share: on_step("contact", share))
    light = trace(
        design,
        states,
        accuracy=TABLE_ACCURACY,
        seed=seed,
        on_step=lambda done, total: on_step("light", done / total),
    )
    return table_of(states, light.flux * np.array(gain.counts_per_flux), is_whole=not cavity.workspace.arcs)


def _config(design: SensorDesign, gain: SimulatedGain | None) -> DriverConfig:
    from fabrication.driver_config import driver_config

    if gain is None:
        return driver_config(design)
    return driver_config(design, gain.counts_per_flux, gain.untouched_readings(design))


def source_of(design: SensorDesign, out: Path) -> DriverSource:
    """The configuration of a design: its bundle's, or, where it has none yet, one made here.

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    from design.rules.check import require_valid
    from fabrication.bundle import bundle_name

    require_valid(design)
    bundle = out / bundle_name(design)
    file = bundle / "fabrication" / "driver.toml"
    if file.is_file():
        config = load_driver_config(file, digest=design.digest)
        return DriverSource(config=config, design=design, bundle=bundle)
    return DriverSource(config=_config(design, None), design=design, bundle=None)


def fitting_model(file: Path, config: DriverConfig) -> TouchModel:
    """A trained model of a sensor; refused before a port is opened.

    Raises
    ------
    InputError : no model, or another design's; the message names the file.
    """
    from fabrication.driver.descriptor import descriptor_of
    from fabrication.driver.touch_reader import require_fits
    from sims.learning.inference.model_file import load_model

    model = load_model(file)
    try:
        require_fits(model.header, descriptor_of(config))
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    return model


def _bundle_of(file: Path) -> Path | None:
    folder = file.resolve().parent.parent
    return folder if (folder / "manifest.json").is_file() else None


def _is_driver_file(file: Path) -> bool:
    """Whether a file is a driver configuration and no design: it says so by its format version."""
    try:
        return file.is_file() and "format_version" in parsed_toml(read_design_text(file))
    except (DesignError, ValueError):
        return file.name == "driver.toml"  # a damaged one has its own message
