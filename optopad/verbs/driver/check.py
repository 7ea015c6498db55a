"""Tests the parts of the built sensor against the simulated pattern of light."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from optopad.cli.verb import checked_out, file_name, typed, verb
from optopad.design.io import write_text_atomically
from optopad.design.progress import OnStep
from optopad.fabrication.driver.check import check_frames
from optopad.fabrication.driver.sensor import Sensor
from optopad.screen.live_sensor import check_lines, link_json
from optopad.screen.output import Told
from optopad.sensor import driver_source, with_expected_pattern
from optopad.work import OUT


@verb(
    seconds=typed("S", min=0.1),
    out=typed("FILE", type=Path, callback=file_name(".json")),
)
def check(
    config: str,
    *,
    port: str | None = None,
    rate: float | None = None,
    accept_digest: str | None = None,
    patience: float | None = None,
    seconds: float = 1.5,
    out: Path | None = None,
    set_: Sequence[str] = (),
    bundles: Path = Path(OUT),
    seed: int = 0,
    on_step: OnStep,
) -> Told:
    """Test every LED and photodiode of the untouched pad against the simulated pattern.

    Parameters
    ----------
    seconds : Duration of the test, with the pad untouched.
    out : Also write the result as JSON.
    """
    if out is not None:
        checked_out(out, config)
    expected = with_expected_pattern(driver_source(config, set_, bundles), seed=seed, on_step=on_step)
    with Sensor(
        expected, port, rate_hz=rate, accept_digest=accept_digest, patience_s=patience, baseline_s=0.0
    ) as sensor:
        sensor.read()
        verdict = check_frames(sensor.frames(seconds=seconds), sensor.descriptor, sensor.self_test())
        document = {**verdict.to_json(), "link": link_json(sensor)}
    if out is not None:
        write_text_atomically(out, json.dumps(document, indent=2) + "\n")
    return Told(document, check_lines(verdict))
