"""Simulates the light of chosen presses, or the data set of a press protocol, and writes it into the bundle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from optopad.cli.verb import parsed_press, typed, verb
from optopad.design.arrays import FloatArray
from optopad.design.draft import Draft
from optopad.design.errors import InputError, ModelScopeError
from optopad.design.press_protocol import PressProtocol, load_protocol_file
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.shape.cavity import CavityGeometry, cavity_of
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name, program_digest
from optopad.screen.output import Told
from optopad.screen.training import data_lines, signal_lines
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.scope import contact_of
from optopad.sims.optics.accuracy import LightSignals
from optopad.sims.optics.tracing import trace
from optopad.sims.press import depth_schedule_mm
from optopad.sims.readings.data_writer import DataWriter
from optopad.sims.readings.dataset import clipped_note, read_data
from optopad.sims.readings.protocol import data_header, drawn_presses, protocol_curves
from optopad.sims.readings.readout import save_dataset, signals_dataset
from optopad.sims.readings.signal_chain import chain_of
from optopad.work import OUT

Press = tuple[float, float, float]


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
    require_valid(design)
    with bundle(design, out, seed=seed) as folder:
        (folder / "sims").mkdir(exist_ok=True)
        made = _signals(design, [parsed_press(text) for text in press], folder / "sims", seed, on_step)
    return Told(made, [*signal_lines(made), f"files     {out / bundle_name(design)}"])


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


def _signals(
    design: SensorDesign, presses: list[Press], folder: Path, seed: int, on_step: OnStep
) -> dict[str, Any]:
    """Compute the signals of presses and write ``presses.nc`` into ``folder``; returns a summary.

    Parameters
    ----------
    presses : rows of x, y, depth [mm]; empty for default depths at the workspace's centre
    """
    cavity = cavity_of(design)
    states = np.array(presses) if presses else _default_presses(design, cavity)
    require_presses(design, states)
    deepest_mm = max(design.operating.max_depth_mm, float(states[:, 2].max()))  # the trace needs this depth
    solved_press(contact_of(design), max_depth_mm=deepest_mm, on_step=lambda s: on_step("contact", s))
    light = trace(
        Draft.of(design), states, seed=seed, on_step=lambda done, total: on_step("light", done / total)
    )
    save_dataset(signals_dataset(light, cavity), folder / "presses.nc")
    return {
        "name": design.name,
        "digest": design.digest,
        "seed": seed,
        "states": [_state_summary(light, number) for number in range(len(states))],
    }


def require_presses(design: SensorDesign, states: FloatArray) -> None:
    """Raise an error for presses outside the workspace, above the surface, or deeper than the contact model covers.

    states : (press, 3) x, y, depth [mm]
    """
    space = cavity_of(design).workspace
    for x_mm, y_mm, depth_mm in states:
        if depth_mm < 0.0:
            raise InputError(
                f"--press: depth {depth_mm:g} mm is refused: depth is measured from the untouched surface "
                "down; give 0 or more"
            )
        contact_of(design).require_depth(float(depth_mm), "--press")
        if not space.contains(float(x_mm), float(y_mm)):
            raise ModelScopeError(
                f"--press: ({x_mm:g}, {y_mm:g}) mm is outside the workspace, {space.words}; press inside, or lower "
                "operating.workspace_margin_mm"
            )


def _default_presses(design: SensorDesign, cavity: CavityGeometry) -> FloatArray:
    space = cavity.workspace
    x_mm, y_mm = (space.x0_mm + space.x1_mm) / 2, (space.y0_mm + space.y1_mm) / 2
    depths = depth_schedule_mm(design.operating.max_depth_mm)
    return np.array([[x_mm, y_mm, float(depth)] for depth in depths])


def _state_summary(light: LightSignals, state: int) -> dict[str, Any]:
    return {
        "press_mm": light.presses[state].tolist(),
        "mean_flux": float(light.flux[state].mean()),
        "mean_flux_by_class": {name: float(flux[state].mean()) for name, flux in light.by_class.items()},
        "largest_standard_error": float(light.standard_error[state].max()),
        "flux": light.flux[state].tolist(),
    }
