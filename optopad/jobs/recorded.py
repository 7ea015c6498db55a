"""Simulates the data set of a press protocol, which is written into the design's bundle."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from optopad.design.press_protocol import PressProtocol
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name, program_digest


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
