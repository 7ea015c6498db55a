"""Records raw frames of the built sensor."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path

from optopad.cli.verb import file_name, typed, verb
from optopad.design.errors import DeviceError, InputError
from optopad.fabrication.driver.recording.export import can_export, read_recorded, write_netcdf
from optopad.fabrication.driver.recording.raw import SUFFIX
from optopad.fabrication.driver.sensor import Sensor
from optopad.screen.live_sensor import link_json, link_line
from optopad.screen.output import Told
from optopad.sensor import DriverSource, driver_source
from optopad.verbs.driver.read import follow, until_interrupted
from optopad.work import OUT


@verb(
    out=typed("FILE", type=Path, callback=file_name(".optorec", ".mcap")),
    netcdf=typed(flag="--netcdf/--no-netcdf"),
)
def record(
    config: str,
    *,
    port: str | None = None,
    out: Path | None = None,
    rate: float | None = None,
    frames: int | None = None,
    seconds: float | None = None,
    accept_digest: str | None = None,
    patience: float | None = None,
    netcdf: bool = True,
    set_: Sequence[str] = (),
    bundles: Path = Path(OUT),
    as_json: bool = False,
) -> Told:
    """Record raw frames into a file that stays readable after any interruption. Ctrl-C ends the recording.

    Parameters
    ----------
    out : A new file (.optorec, or .mcap for ROS 2 and Foxglove); default: the design's name and the time.
    netcdf : Also write the netCDF next to it at the end.
    """
    if seconds is not None and not seconds > 0.0:
        raise InputError(
            f"--seconds: {seconds:g} is refused: give more than 0, or leave it out and end with Ctrl-C"
        )
    source = driver_source(config, set_, bundles)
    file = out or _default_file(source)
    with (
        Sensor(
            source.config,
            port,
            rate_hz=rate,
            accept_digest=accept_digest,
            patience_s=patience,
            baseline_s=0.0,
        ) as sensor,
        sensor.record(file) as recorder,
    ):
        try:
            with until_interrupted():
                enough = frames or math.inf
                follow(sensor, None, seconds, quiet=as_json, is_over=lambda: recorder.frames >= enough)
        except DeviceError as err:
            raise DeviceError(f"{err}; {file} has the {recorder.frames} frames before") from err
        recorder.close()
        link, line = link_json(sensor), link_line(sensor)
    made = _netcdf_beside(file) if netcdf else None
    return Told(
        {
            "file": str(file),
            "netcdf": None if made is None else str(made),
            "recorded": recorder.frames,
            "link": link,
        },
        [line, f"files     {file} ({recorder.frames} frames){'' if made is None else f', {made}'}"],
    )


def _default_file(source: DriverSource) -> Path:
    return Path(f"{source.config.design}-{time.strftime('%Y%m%d-%H%M%S')}{SUFFIX}")


def _netcdf_beside(file: Path) -> Path | None:
    """Convert a complete recording to netCDF in the same folder; None if that fails or the file exists."""
    target = file.with_suffix(".nc")
    if not can_export() or target.exists():  # of another recording: not overwritten
        return None
    try:
        write_netcdf(read_recorded(file), target, file.name)
    except InputError:
        return None  # no frame arrived before the end
    return target
