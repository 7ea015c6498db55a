"""Simulates the light of chosen presses, or the data set of a press protocol, and writes it into the bundle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from optopad.cli.options import parsed_press
from optopad.cli.verb import typed, verb
from optopad.design.errors import InputError
from optopad.design.press_protocol import PressProtocol, load_protocol_file
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name, program_digest
from optopad.jobs.pipeline import write_signals
from optopad.screen.output import Told
from optopad.screen.simulation import data_lines, signal_lines
from optopad.sims.readings.data_writer import DataWriter
from optopad.sims.readings.dataset import clipped_note, read_data
from optopad.sims.readings.protocol import data_header, drawn_presses, protocol_curves
from optopad.sims.readings.signal_chain import chain_of
from optopad.work import OUT


@verb(press=typed("X,Y,DEPTH"), protocol=typed("NAME|FILE"), set_before="out")
def simulate(
    design: SensorDesign,
    *,
    press: Sequence[str] = (),
    protocol: str | None = None,
    fit: bool = False,
    out: Path = Path(OUT),
    seed: int = 0,
    on_step: OnStep,
) -> Told:
    """Compute the light of chosen presses by path class, or the data set of a press protocol; netCDF in the bundle.

    Parameters
    ----------
    press : A press [mm]; repeatable. Default: centre, all depths.
    protocol : Press by a protocol and make its data set: piacenza2017, piacenza2017-quick, or a file.
    fit : With --protocol: leave out depths beyond the design's range.
    """
    if protocol is not None:
        if press:
            raise InputError("--press: does not go with --protocol, which has presses of its own; drop one")
        asked = load_protocol_file(protocol)
        made = _protocol_data(design, asked.fitted_to(design) if fit else asked, out, seed, on_step)
        return Told(made, data_lines(made))
    if fit:
        raise InputError("--fit: needs --protocol, whose depths it fits; drop it")
    presses = [parsed_press(text) for text in press]
    made, folder = write_signals(design, presses, out, seed=seed, on_step=on_step)
    return Told(made, [*signal_lines(made), f"files     {folder}"])


def _protocol_data(
    design: SensorDesign, protocol: PressProtocol, out: Path, seed: int, on_step: OnStep
) -> dict[str, Any]:
    """Simulate a press protocol and write its data set into the bundle; returns a summary.

    Stored results of light tracing are reused, as are finished presses of an interrupted run of the same work.

    Raises
    ------
    DesignError : the design breaks a rule; nothing is written.
    ModelScopeError : a press of the protocol is outside the design's workspace, or too deep.
    OutputError : the folder cannot be written; an earlier bundle is intact.
    """
    require_valid(design)
    counted = protocol.summary(design)
    curves = protocol_curves(design, protocol, on_step=on_step)
    chain = chain_of(design, curves.readout)
    header = data_header(curves, chain, seed)
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        file = folder / "sims" / f"data-{protocol.name}-{seed}.nc"
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
