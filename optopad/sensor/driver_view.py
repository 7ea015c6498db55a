"""Output of `driver read` and `driver check`: a live table and heat map for a terminal, otherwise lines and JSON.

The module also chooses the driver configuration that an argument of the command line or of `optopad.Sensor` names, and
simulates its light.

A `driver.toml` is used directly, and a bundle's folder contains one. For a design or preset, the file in its bundle in
`outputs` is used; if the bundle has none, a configuration is made in memory. With the driver alone, only designs are
refused.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.progress import OnStep
from optopad.fabrication.driver import sensor as driver
from optopad.fabrication.driver.check import Verdict
from optopad.fabrication.driver.link.frames import Frame
from optopad.fabrication.driver.simulated.press_table import (
    PressTable,
    table_from_signals,
    table_of,
    untouched_table,
)
from optopad.fabrication.driver_file import DriverConfig, driver_file_of, load_driver_config

if TYPE_CHECKING:
    from rich.console import RenderableType

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


def driver_source(where: str, changes: list[str] | None, out: Path) -> DriverSource:
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
    source: DriverSource, *, is_still: bool = False, seed: int, on_step: OnStep
) -> tuple[DriverConfig, PressTable]:
    """Configuration of a fake board, and its readings under presses.

    The readings come from the bundle's signals if there are any, otherwise from a draft simulation. If the design is
    not known either, there are only readings of the untouched pad.

    Parameters
    ----------
    is_still : whether nothing presses the pad; if True, no press is simulated
    """
    if source.bundle is not None and source.config.gain.counts_per_flux is not None:
        signals = source.bundle / "sims" / "signals.nc"
        if signals.is_file():
            return source.config, table_from_signals(signals, source.config)
    if source.design is None:
        return source.config, untouched_table(source.config)
    gain = simulated_gain(source.design, seed=seed, on_step=on_step)
    config = _config(source.design, gain)
    if is_still:
        return config, untouched_table(config)
    return config, _simulated_table(source.design, gain, seed=seed, on_step=on_step)


def simulated_gain(design: SensorDesign, *, seed: int, on_step: OnStep) -> SimulatedGain:
    """Gains, and light of the untouched pad, computed as by a score."""
    from optopad.design.shape.cavity import cavity_of, judged_pairs, mask_of
    from optopad.fabrication.gain import SimulatedGain
    from optopad.sims.readings.readout import readout_of
    from optopad.sims.verdict.presses import untouched_flux

    cavity = cavity_of(design)
    flux = untouched_flux(design, cavity, seed=seed)
    readout = readout_of(design, flux, mask_of(judged_pairs(cavity), cavity))
    on_step("light", 0.0)
    return SimulatedGain(
        counts_per_flux=readout.of_each(flux.shape[1]), untouched_flux=tuple(map(tuple, flux.tolist()))
    )


def _simulated_table(design: SensorDesign, gain: SimulatedGain, *, seed: int, on_step: OnStep) -> PressTable:
    import numpy as np

    from optopad.design.shape.cavity import cavity_of
    from optopad.sims.contact.indentation import solved_press
    from optopad.sims.optics.tracing import trace
    from optopad.sims.verdict.pad_map import COARSE_PLACES, grid_places_mm, map_grid_mm
    from optopad.sims.verdict.presses import states_of

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


def fitting_model(file: Path, config: DriverConfig) -> TouchModel:
    """A trained model of a sensor; other files are refused before a port is opened.

    Raises
    ------
    InputError : the file is not a model, or is a model of another design; the message names the file.
    """
    from optopad.fabrication.driver.descriptor import descriptor_of
    from optopad.fabrication.driver.touch_reader import require_fits
    from optopad.sims.learning.inference.model_file import load_model

    model = load_model(file)
    try:
        require_fits(model.header, descriptor_of(config))
    except InputError as err:
        raise InputError(f"{file}: {err}") from None
    return model


def _bundle_of(file: Path) -> Path | None:
    folder = file.resolve().parent.parent
    return folder if (folder / "manifest.json").is_file() else None


FULL_CHANGE = 0.5
"""Change of a signal, as a share of its baseline, that has the strongest colour."""

FAINTEST = 0.1
"""Share of the full change below which a cell keeps the terminal's own colour."""

CELL_WIDTH = 6
NAME_WIDTH = 5
OTHER_LINES = 5
"""Number of lines of the live view, not counting those of the emitters."""

LESS, MORE = (31, 102, 209), (209, 92, 20)
"""Colours (red, green, blue) of less and of more light than without contact; no change has the terminal's colour."""


def frame_json(frame: Frame, digits: int = 5) -> dict[str, Any]:
    """A frame as plain data; a ratio with a denominator near zero is null."""
    ratio = None if frame.baseline is None else _plain(np.round(frame.normalised, digits))
    return {
        "connection": frame.connection,
        "sequence": frame.sequence,
        "device_us": frame.device_us,
        "host_s": round(frame.host_s, 6),
        "lost_before": frame.lost_before,
        "counts": frame.counts.tolist(),
        "signals": frame.signals.tolist(),
        "normalised": ratio,
        "saturated": int(frame.saturated.sum()),
    }


def link_json(sensor: driver.Sensor) -> dict[str, Any]:
    """Port, board, and events on the line, as plain data."""
    counts = sensor.counts
    return {
        "port": sensor.port,
        "design": sensor.config.design,
        "digest": sensor.config.digest,
        "board_digest": sensor.hello.digest,
        "firmware": ".".join(map(str, sensor.hello.firmware)),
        "rate_hz": sensor.rate_hz,
        **{name: getattr(counts, name) for name in type(counts).__dataclass_fields__},
    }


def link_line(sensor: driver.Sensor) -> str:
    """One line with the frame rate, and the numbers of received, lost and damaged frames."""
    counts, rate = sensor.counts, sensor.rate_hz
    told = "-" if rate is None else f"{rate:.1f}"
    text = f"{counts.frames} frames, {told} Hz, {counts.lost} lost, {counts.damaged} damaged"
    rare = {"doubled": counts.doubled, "reconnects": counts.reconnects}
    return text + "".join(f", {number} {name}" for name, number in rare.items() if number)


def strongest_change(frame: Frame, sensor: driver.Sensor) -> str:
    """The pair that changed most relative to its baseline."""
    if frame.baseline is None or not np.isfinite(frame.normalised).any():
        return ""
    change = np.nan_to_num(frame.normalised - 1.0)
    i, j = np.unravel_index(int(np.abs(change).argmax()), change.shape)
    said = sensor.descriptor
    return f"{said.emitters.names[i]}-{said.receivers.names[j]} {change[i, j]:+.0%}"


def live_table(frame: Frame, sensor: driver.Sensor, size: tuple[int, int]) -> RenderableType:
    """Heat map of normalised signals, one line per emitter, below a line about the link and above an explanation.

    Parameters
    ----------
    size : columns and lines of the terminal; a layout whose numbers do not fit is drawn as coloured blocks
    """
    from rich.console import Group
    from rich.text import Text

    said = sensor.descriptor
    ratio = frame.normalised if frame.baseline is not None else np.full(frame.signals.shape, np.nan)
    emitters, receivers = said.emitters.names, said.receivers.names
    if NAME_WIDTH + CELL_WIDTH * len(receivers) <= size[0] and len(emitters) + OTHER_LINES <= size[1]:
        view = _numbers(frame, ratio, emitters, receivers)
        foot = "% of the untouched signal   ! at full scale   . too weak   Ctrl-C ends"
    else:
        view = _blocks(frame, ratio, emitters, receivers, wide=NAME_WIDTH + 2 * len(receivers) <= size[0])
        change = strongest_change(frame, sensor)
        foot = (
            f"blue: less light, orange: more, white: at full scale, black: too weak   {change}   Ctrl-C ends"
        )
    head = f"{said.design} on {sensor.port}: {link_line(sensor)}"
    return Group(Text(head, style="bold"), view, Text(foot, style="dim"))


def _numbers(
    frame: Frame, ratio: FloatArray, emitters: tuple[str, ...], receivers: tuple[str, ...]
) -> RenderableType:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=0, collapse_padding=True)
    table.add_column("", min_width=NAME_WIDTH)
    for name in receivers:
        table.add_column(Text(name + " "), justify="right", min_width=CELL_WIDTH)
    for i, name in enumerate(emitters):
        table.add_row(name, *(_cell(frame, ratio, i, j) for j in range(len(receivers))))
    table.add_row("dark", *(f"{int(count)} " for count in frame.counts[-1]), style="dim")
    return table


def _blocks(
    frame: Frame, ratio: FloatArray, emitters: tuple[str, ...], receivers: tuple[str, ...], *, wide: bool
) -> RenderableType:
    """Heat map of coloured blocks: a line shows two emitters, and every eighth receiver has a name."""
    from rich.text import Text

    step = 2 if wide else 1
    heads = "".join(name.ljust(8 * step) for name in receivers[::8])
    text = Text(" " * NAME_WIDTH + heads[: step * len(receivers)] + "\n", style="dim", no_wrap=True)
    for i in range(0, len(emitters), 2):
        text.append(emitters[i].ljust(NAME_WIDTH), style="not dim")
        for j in range(len(receivers)):
            upper = _colour(frame, ratio, i, j)
            lower = f" on {_colour(frame, ratio, i + 1, j)}" if i + 1 < len(emitters) else ""
            text.append("▀" * step, style=f"not dim {upper}{lower}")
        text.append("\n")
    return text


def _colour(frame: Frame, ratio: FloatArray, i: int, j: int) -> str:
    if frame.saturated[i, j]:
        return "rgb(255,255,255)"
    if not math.isfinite(ratio[i, j]):
        return "rgb(0,0,0)"
    return _mixed(float(ratio[i, j]) - 1.0)


def check_lines(verdict: Verdict) -> list[str]:
    """Lines of a check's result, for a person to read."""
    lines = [
        f"{'problem' if problem.is_error else 'note':<9} {problem.kind}: {problem.message}"
        for problem in verdict.problems
    ]
    if verdict.clipped_by_design:
        lines.append(f"{'note':<9} at full scale by design: {', '.join(verdict.clipped_by_design)}")
    if verdict.gain is not None and verdict.mismatch is not None:
        lines.append(
            f"{'pattern':<9} {verdict.compared} pairs compared over {verdict.frames} frames: {verdict.gain:.2f} times "
            f"the simulated readings, single pairs off by {verdict.mismatch:.0%} in the middle"
        )
    wrong = sum(problem.is_error for problem in verdict.problems)
    lines.append(f"{'verdict':<9} {'wired as designed' if verdict.is_good else f'{wrong} to fix'}")
    return lines


def _cell(frame: Frame, ratio: FloatArray, i: int, j: int) -> Any:
    from rich.text import Text

    mark = "!" if frame.saturated[i, j] else ""
    if not math.isfinite(ratio[i, j]):
        return Text(f"{mark or '.'} ".rjust(CELL_WIDTH), style="dim")
    return Text(f"{mark}{100 * ratio[i, j]:.0f} ".rjust(CELL_WIDTH), style=_style(float(ratio[i, j]) - 1.0))


def _style(change: float) -> str:
    return "" if abs(change) < FAINTEST * FULL_CHANGE else f"white on {_mixed(change)}"


def _mixed(change: float) -> str:
    share = min(abs(change) / FULL_CHANGE, 1.0)
    red, green, blue = (round(30 + (part - 30) * share) for part in (LESS if change < 0 else MORE))
    return f"rgb({red},{green},{blue})"


def _plain(values: FloatArray) -> list[list[float | None]]:
    return [[float(value) if math.isfinite(value) else None for value in row] for row in values]
