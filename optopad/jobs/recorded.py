"""Compares a design with a recording of its manufactured pad, and simulates the data set of a press protocol.

Figures, numbers and data sets are written into the design's bundle.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.errors import InputError
from optopad.design.io import write_text_atomically
from optopad.design.press_protocol import PressProtocol
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name, program_digest
from optopad.sims.learning.recorded_press import RecordedPair, RecordedPress, recorded_press
from optopad.sims.readings.recording import read_recording
from optopad.work import as_netcdf


def data_file_name(protocol: PressProtocol, seed: int) -> str:
    """Name of the data set's file in the bundle's ``sims`` folder."""
    return f"data-{protocol.name}-{seed}.nc"


def write_protocol_data(
    design: SensorDesign, protocol: PressProtocol, out: Path, *, seed: int, on_step: OnStep
) -> dict[str, Any]:
    """Simulate a press protocol and write its data set into the bundle; returns a summary.

    Stored results of light tracing are reused, as are finished presses of an interrupted run of the same work.

    Raises
    ------
    DesignError : the design breaks a rule; nothing is written.
    ModelScopeError : a press of the protocol is outside the design's workspace, or too deep.
    OutputError : the folder cannot be written; an earlier bundle is intact.
    """
    from optopad.sims.readings.data_writer import DataWriter
    from optopad.sims.readings.dataset import clipped_note, read_data
    from optopad.sims.readings.protocol import data_header, drawn_presses, protocol_curves
    from optopad.sims.readings.signal_chain import chain_of

    require_valid(design)
    counted = protocol.summary(design)
    curves = protocol_curves(design, protocol, on_step=on_step)
    chain = chain_of(design, curves.readout)
    header = data_header(curves, chain, seed)
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        file = folder / "sims" / data_file_name(protocol, seed)
        with DataWriter(file, header, asked=[seed, program_digest()], journal_folder=out) as writer:
            taken_up, total = len(writer.done), sum(counted["presses"])
            for press in drawn_presses(curves, chain, seed=seed, but=writer.done):
                writer.add(press)
                on_step("data", len(writer.done) / total)
            writer.write()
        data = read_data(file)
    writer.forget()  # the bundle now contains the file
    left = chain.flicker_sigma_counts()
    return {
        "name": design.name,
        "digest": design.digest,
        "seed": seed,
        "file": str(out / bundle_name(design) / "sims" / file.name),
        "protocol": counted,
        "sets": [
            asdict(one) | {"presses": presses}
            for one, presses in zip(data.sets, counted["presses"], strict=True)
        ],
        "samples": len(data),
        "taken_up_presses": taken_up,
        "counts_per_flux": list(curves.readout.of_each(len(data.receiver_names))),
        "ambient_residual_counts": float(np.sqrt((left**2).mean())),
        "clipped": clipped_note(data),
    }


def data_lines(summary: dict[str, Any]) -> list[str]:
    """Text that summarises the data set, in a few lines."""
    protocol = summary["protocol"]
    lines = [
        f"protocol  {protocol['name']}: {protocol['points_per_press']} points a press, "
        f"{protocol['touched_per_press']} of them at 0 mm or deeper; {summary['samples']} samples, "
        f"{protocol['hours']:.1f} h on a stage"
    ]
    lines += [
        f"set       {one['name']:<20} {one['role']:<6} {one['pattern']:<7} "
        f"{'ambient' if one['is_ambient'] else 'dark':<8} {one['presses']} presses"
        for one in summary["sets"]
    ]
    if summary["taken_up_presses"]:
        lines.append(f"reused    {summary['taken_up_presses']} presses of an interrupted run")
    if summary["clipped"]:
        lines.append(f"warning   {summary['clipped']}")
    return [*lines, f"file      {summary['file']}"]


@dataclass(frozen=True, kw_only=True)
class ComparedRecording:
    """A comparison of simulated and recorded presses, and the paths of its files."""

    press: RecordedPress
    digest: str
    recording: str
    folder: Path
    stem: str

    def to_json(self) -> dict[str, Any]:
        """The comparison as plain data for JSON."""
        return {
            "digest": self.digest,
            "recording": self.recording,
            "place_mm": [round(value, 4) for value in self.press.place_mm],
            "pairs": [_pair_json(pair) for pair in self.press.pairs],
            "notes": list(self.press.notes),
            "files": str(self.folder),
        }


def compare_recording(
    design: SensorDesign,
    file: Path,
    out: Path,
    *,
    pairs: Sequence[str],
    at: str | None,
    seed: int,
    topic: str | None = None,
    press_topic: str | None = None,
    on_step: OnStep,
) -> ComparedRecording:
    """Compare a recording with the simulated presses of its design.

    Parameters
    ----------
    file : netCDF, table, recording of the driver, or ROS 2 bag (file or folder)
    topic, press_topic : topics of frames and presses in a bag of several sensors

    Raises
    ------
    DesignError, InputError : the design, the recording, a pair or the location is invalid; nothing is written.
    """
    from optopad.plot_files import write_plot
    from optopad.sims.plots.signal import plot_recorded
    from optopad.sims.plots.style import plain_style

    require_valid(design)
    with as_netcdf(file, topic, press_topic) as netcdf:
        recording = read_recording(netcdf, design)
    on_step("light", 0.0)
    press = recorded_press(design, recording, pairs=tuple(pairs), at_mm=_parsed_place(at), seed=seed)
    on_step("light", 1.0)
    name = _content_digest(file, topic, press_topic)[:8]
    found = ComparedRecording(
        press=press,
        digest=design.digest,
        recording=str(file),
        folder=out / bundle_name(design) / "sims",
        stem=f"recorded-{name}",
    )
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        stem = folder / "sims" / found.stem
        text = json.dumps(found.to_json(), indent=2, allow_nan=False) + "\n"
        write_text_atomically(stem.with_name(f"{stem.name}.json"), text)
        with plain_style():
            write_plot(plot_recorded(press), stem)
    return found


def _content_digest(file: Path, *topics: str | None) -> str:
    """SHA-256 of a recording's content, or of the files in its folder, and of the chosen topics."""
    digest = hashlib.sha256()
    for one in sorted(file.iterdir()) if file.is_dir() else [file]:
        if one.is_file():
            with one.open("rb") as stream:
                while piece := stream.read(1 << 20):
                    digest.update(piece)
    for topic in topics:
        digest.update((topic or "").encode())
    return digest.hexdigest()


def recorded_lines(found: ComparedRecording) -> list[str]:
    """Text that summarises a comparison of simulated and recorded presses, in a few lines."""
    x_mm, y_mm = found.press.place_mm
    lines = [f"press     at x {x_mm:g}, y {y_mm:g} mm"]
    for pair in found.press.pairs:
        modes = pair.simulated.score.modes
        lines.append(
            f"{pair.simulated.name:<9} measured and simulated differ by {pair.rms:.1%} of the untouched "
            f"signal (rms; {pair.worst:.1%} at most); untouched {pair.untouched_counts:.0f}; mode 1 to "
            f"{modes.mode1_mm[1]:.2f} mm, mode 2 "
            + ("never" if modes.mode2_mm[0] is None else f"from {modes.mode2_mm[0]:.2f} mm")
        )
    return lines + [f"note      {text}" for text in found.press.notes]


def _pair_json(pair: RecordedPair) -> dict[str, Any]:
    return {
        "pair": pair.simulated.name,
        "rms": round(pair.rms, 5),
        "worst": round(pair.worst, 5),
        "untouched_counts": round(pair.untouched_counts, 3),
        "depth_mm": pair.depth_mm.round(4).tolist(),
        "measured": pair.ratio.round(5).tolist(),
        "press_readings": pair.deepest + 1,
        "simulated_depth_mm": pair.simulated.curves.depth_mm.tolist(),
        "simulated": (pair.simulated.curves.total / pair.simulated.curves.total[0]).round(6).tolist(),
    }


def _parsed_place(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        x_mm, y_mm = (float(number) for number in text.split(","))
    except ValueError:
        raise InputError(f"--at: {text!r} is refused: write X,Y in millimetres, as 10,10") from None
    return x_mm, y_mm
