"""The driver's configuration that an argument of the command line or of `optopad.Sensor` names, and its light.

A `driver.toml` is used directly, and a bundle's folder contains one. For a design or preset, the file in its bundle in
`outputs` is used; if the bundle has none, a configuration is made in memory. With the driver alone, only designs are
refused.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.fabrication.driver import sensor as driver
from optopad.fabrication.driver.simulated.press_table import (
    PressTable,
    SignalTable,
    SplineTable,
    gains_of,
    table_from_signals,
    table_of,
    untouched_table,
)
from optopad.fabrication.driver_file import DriverConfig, driver_file_of, load_driver_config

if TYPE_CHECKING:
    from optopad.design.spec import SensorDesign
    from optopad.fabrication.gain import SimulatedGain
    from optopad.sims.learning.inference.touch_model import TouchModel

TABLE_DEPTHS_MM = (0.0, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
"""Depths simulated for the fake board [mm]; the design's deepest press is added, and deeper ones are left out."""

TABLE_ACCURACY = "draft"


@dataclass(frozen=True, kw_only=True)
class DriverSource:
    """A configuration, its design if that is known, and its bundle."""

    config: DriverConfig
    design: SensorDesign | None
    bundle: Path | None


def driver_source(where: str, changes: Sequence[str] | None, out: Path) -> DriverSource:
    """The configuration that an argument of the command line names.

    Parameters
    ----------
    where : driver.toml, bundle folder, design file or preset
    changes : `--set` of a design
    out : folder of the bundles

    Raises
    ------
    InputError, DesignError : the file or preset does not exist or is damaged, or `--set` is given without a design.
    """
    file = driver_file_of(where)
    if file is not None:
        if changes:
            raise InputError(f"--set: {where} is a finished file; name the design and change that")
        return DriverSource(config=load_driver_config(file), design=None, bundle=_bundle_of(file))
    from optopad.work import read_design

    return source_of(read_design(where, changes), out)


class Sensor(driver.Sensor):
    """The driver's `Sensor`, which also takes a bundle's folder, a design file or the name of a preset.

    Parameters
    ----------
    config : path of a driver.toml, bundle folder or design file, the name of a preset, or the configuration itself. A
        design's bundle is searched in the folder `outputs`, as `optopad driver read` does
    options : port, rate_hz and all others of `optopad.fabrication.driver.Sensor`

    Raises
    ------
    InputError, DesignError : nothing of this name exists or it is damaged, or a design is named where only the driver
        is installed.
    """

    def __init__(
        self, config: str | os.PathLike[str] | DriverConfig, port: str | None = None, **options: Any
    ) -> None:
        if not isinstance(config, DriverConfig):
            try:
                config = driver_source(os.fspath(config), None, Path("outputs")).config
            except ModuleNotFoundError as err:
                raise InputError(
                    f"{config}: no driver.toml and no bundle's folder; the driver alone reads no designs, because "
                    f"{err.name} is not installed: name the bundle, or run `pip install '.[design]'` in the checkout"
                ) from None
        super().__init__(config, port, **options)


def with_expected_pattern(source: DriverSource, *, seed: int, on_step: OnStep) -> DriverConfig:
    """The configuration with the expected readings of the untouched pad, which are simulated if they are missing.

    Raises
    ------
    InputError : the expected readings are missing, and the design to simulate is not known.
    """
    if source.config.expected is not None:
        return source.config
    if source.design is None:
        untouched_table(source.config)  # raises an error that says what to do
    assert source.design is not None
    return _config(source.design, simulated_gain(source.design, seed=seed, on_step=on_step))


def press_table(
    source: DriverSource, *, fingers: int = 1, seed: int, on_step: OnStep
) -> tuple[DriverConfig, SignalTable]:
    """Configuration of a fake board, and its readings under presses.

    The readings come from the bundle's signals if there are any, otherwise from a draft simulation. If the design is
    not known either, there are only readings of the untouched pad. Two fingers press a map of a known design, because
    a model of two touches may explain the linear interpolation of the other tables by a second touch.

    Parameters
    ----------
    fingers : number of fingers; if 0, no press is simulated
    """
    if fingers > 1 and source.design is not None:
        return _mapped_table(source.config, source.design, seed=seed, on_step=on_step)
    if source.bundle is not None and source.config.gain.counts_per_flux is not None:
        signals = source.bundle / "sims" / "signals.nc"
        if signals.is_file():
            return source.config, table_from_signals(signals, source.config)
    if source.design is None:
        return source.config, untouched_table(source.config)
    gain = simulated_gain(source.design, seed=seed, on_step=on_step)
    config = _config(source.design, gain)
    if not fingers:
        return config, untouched_table(config)
    return config, _simulated_table(source.design, gain, seed=seed, on_step=on_step)


def simulated_gain(design: SensorDesign, *, seed: int, on_step: OnStep) -> SimulatedGain:
    """Gains, and light of the untouched pad, computed as by a score."""
    from optopad.design.draft import Draft
    from optopad.design.shape.cavity import judged_pairs, mask_of
    from optopad.fabrication.gain import SimulatedGain
    from optopad.sims.readings.readout import readout_of
    from optopad.sims.verdict.presses import untouched_flux

    draft = Draft.of(design)
    flux = untouched_flux(draft, seed=seed)
    readout = readout_of(draft, flux, mask_of(judged_pairs(draft.cavity), draft.cavity))
    on_step("light", 0.0)
    return SimulatedGain(
        counts_per_flux=readout.of_each(flux.shape[1]), untouched_flux=tuple(map(tuple, flux.tolist()))
    )


def _simulated_table(design: SensorDesign, gain: SimulatedGain, *, seed: int, on_step: OnStep) -> PressTable:
    import numpy as np

    from optopad.design.draft import Draft
    from optopad.design.shape.cavity import cavity_of
    from optopad.sims.contact.indentation import solved_press
    from optopad.sims.contact.scope import contact_of
    from optopad.sims.optics.tracing import trace
    from optopad.sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm
    from optopad.sims.verdict.presses import states_of

    cavity, deepest = cavity_of(design), design.operating.max_depth_mm
    depths = np.array(sorted({*(depth for depth in TABLE_DEPTHS_MM if depth < deepest), deepest}))
    places = grid_places_mm(cavity.workspace, *map_grid_mm(cavity, COARSE_PLACES))
    states = states_of(places, depths)
    solved_press(contact_of(design), max_depth_mm=deepest, on_step=lambda share: on_step("contact", share))
    light = trace(
        Draft.of(design),
        states,
        accuracy=TABLE_ACCURACY,
        seed=seed,
        on_step=lambda done, total: on_step("light", done / total),
    )
    return table_of(states, light.flux * np.array(gain.counts_per_flux), is_whole=not cavity.workspace.arcs)


def _mapped_table(
    config: DriverConfig, design: SensorDesign, *, seed: int, on_step: OnStep
) -> tuple[DriverConfig, SplineTable]:
    from optopad.sims.learning.traced_map import QUICK_DEPTH_NODES, QUICK_PITCH_MM, traced_map

    if config.gain.counts_per_flux is None:
        config = _config(design, simulated_gain(design, seed=seed, on_step=on_step))
    known = traced_map(
        design, pitch_mm=QUICK_PITCH_MM, depth_nodes=QUICK_DEPTH_NODES, seed=seed, on_step=on_step
    )
    untouched = (known.untouched * known.is_bright).reshape(known.flux.shape[3:]) * gains_of(config)
    return config, SplineTable(untouched=untouched, ratio_root=known.ratio_root)


def _config(design: SensorDesign, gain: SimulatedGain | None) -> DriverConfig:
    from optopad.fabrication.driver_config import driver_config

    if gain is None:
        return driver_config(design)
    return driver_config(design, gain.counts_per_flux, gain.untouched_readings(design))


def source_of(design: SensorDesign, out: Path) -> DriverSource:
    """The configuration of a design, from its bundle; if the bundle has none, it is made here.

    Raises
    ------
    DesignError : the design breaks a rule.
    """
    from optopad.design.rules.check import require_valid
    from optopad.fabrication.bundle import bundle_name

    require_valid(design)
    bundle = out / bundle_name(design)
    file = bundle / "fabrication" / "driver.toml"
    if file.is_file():
        config = load_driver_config(file, digest=design.digest)
        return DriverSource(config=config, design=design, bundle=bundle)
    return DriverSource(config=_config(design, None), design=design, bundle=None)


def fitting_model(file: Path, config: DriverConfig, touches: int = 1) -> TouchModel:
    """A trained model of a sensor that finds so many touches; other files are refused before a port is opened.

    Raises
    ------
    InputError : the file is not a model, or is a model of another design or of one touch; the message names the file.
    """
    from optopad.fabrication.driver.descriptor import descriptor_of
    from optopad.fabrication.driver.touch_reader import require_fits, require_touches
    from optopad.sims.learning.inference.model_file import load_model
    from optopad.sims.learning.inference.two_touches import require_one_or_two

    require_one_or_two(touches)
    model = load_model(file)
    try:
        require_fits(model.header, descriptor_of(config))
        require_touches(model, touches)
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    return model


def _bundle_of(file: Path) -> Path | None:
    folder = file.resolve().parent.parent
    return folder if (folder / "manifest.json").is_file() else None
