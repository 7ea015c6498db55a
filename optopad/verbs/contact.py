"""One centred press: surface, load, pressure, and the load over a protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from optopad.cli.options import require_folder
from optopad.cli.verb import typed, verb
from optopad.design.arrays import FloatArray
from optopad.design.errors import InputError
from optopad.design.fields.quantity import Quantity
from optopad.design.press_protocol import LoadProtocol, load_protocol
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import modulus
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.report.sections.published import LoadComparison, compared, published_load
from optopad.screen.output import Told
from optopad.sims.contact.force_curve import ForceCurve, force_curve
from optopad.sims.contact.indentation import indent, solved_press
from optopad.sims.contact.load_protocol import LoadHistory, load_history, solid_of
from optopad.sims.contact.pad_surface import contact_notes
from optopad.sims.contact.pressure import ContactPressure, contact_pressure
from optopad.sims.contact.scope import mean_crown, require_depth
from optopad.sims.contact.tip import tip_of
from optopad.sims.press import Indentation, depth_schedule_mm

if TYPE_CHECKING:
    from matplotlib.axes import Axes


TIP_POINTS = 400
TIP_LENGTH = 8.0
"""Length of the tip's outline in a picture [tip radii]; the outline has `TIP_POINTS` points."""
PREFIX = "contact-"
HOW_TO_RELAX = (
    "press and retract have the same load, because relaxation is off; to turn it on, give values measured on the "
    "built pad: --set elastomer.viscoelastic.relaxed_share=... --set elastomer.viscoelastic.time_constant_s=..."
)


@dataclass(frozen=True, kw_only=True)
class ProtocolView:
    """A load protocol (depth of a press over time), and the load during the protocol."""

    name: str
    protocol: LoadProtocol
    history: LoadHistory
    is_elastic: bool


@dataclass(frozen=True, kw_only=True)
class PressView:
    """Results of one centred press.

    Attributes
    ----------
    design : design of the pressed pad
    press : the deformed surface at the requested depth
    tip_mm : outline of the tip: distance from the axis, and height above the tip's lowest point [mm]
    young : Young's modulus used for the loads, with its uncertainty band [MPa]
    force : load against depth
    pressure : contact pressure between tip and pad at the requested depth
    comparison : published and computed load of one press; None without a published load
    driven : the load protocol; None if none was requested
    warnings : warnings about the press
    """

    design: SensorDesign
    press: Indentation
    tip_mm: tuple[FloatArray, FloatArray]
    young: Quantity
    force: ForceCurve
    pressure: ContactPressure
    comparison: LoadComparison | None
    driven: ProtocolView | None
    warnings: tuple[str, ...]

    @property
    def band_n(self) -> tuple[float, float]:
        """Load at both ends of the uncertainty band of Young's modulus [N]."""
        low, high = (self.force.low_n[-1], self.force.high_n[-1]) / self.force.force_n[-1]
        return float(low) * self.press.force_n, float(high) * self.press.force_n

    @property
    def pile_up_mm(self) -> tuple[float, float]:
        """Height of the highest point of the deformed surface, and that point's distance from the tip's axis [mm]."""
        highest = int(self.press.height_mm.argmax())
        return float(self.press.height_mm[highest]), float(self.press.radius_mm[highest])


@verb(protocol=typed("NAME"), out=typed("FOLDER", type=Path, callback=require_folder), set_before="out")
def show(
    design: SensorDesign,
    *,
    depth: float = 2.0,
    protocol: str | None = None,
    out: Path | None = None,
    seed: int = 0,
    on_step: OnStep,
) -> Told:
    """Compute load, surface and pressure of a centred press; with a protocol, also the load in retraction.

    Parameters
    ----------
    depth : Depth of the press [mm].
    protocol : Also the load over a load protocol: piacenza2017.
    out : Also write pictures, as SVG and PNG, into the bundle in this folder.
    """
    view = view_press(design, depth, protocol, on_step=lambda share: on_step("contact", share))
    files = [] if out is None else write_pictures(view, out, seed=seed)
    where = [f"files     {files[0].parent}/contact-*"] if files else []
    return Told(view_json(view) | {"files": [str(file) for file in files]}, [*view_lines(view), *where])


def view_press(
    design: SensorDesign,
    depth_mm: float,
    protocol: str | None,
    on_step: Callable[[float], None] | None = None,
) -> PressView:
    """Solve a centred press and collect its results.

    Parameters
    ----------
    depth_mm : depth of the press [mm]; 0 for the pad without contact
    protocol : name of a load protocol, or None
    on_step : called with the finished fraction of the contact solution

    Raises
    ------
    InputError, ModelScopeError : the depth or the protocol is invalid
    """
    driven = None if protocol is None else load_protocol(protocol)
    if depth_mm < 0.0:
        raise InputError(
            f"--depth: {depth_mm:g} mm is refused: depth is measured from the untouched surface down; give 0 or more"
        )
    require_depth(design, depth_mm, "--depth")
    if driven is not None:
        require_depth(design, driven.deepest_mm.value, f"--protocol {protocol}")
    press = indent(design, 0.0) if depth_mm == 0.0 else None
    deepest = max(depth_mm, design.operating.max_depth_mm, driven.deepest_mm.value if driven else 0.0)
    solved = solved_press(design, deepest, on_step=on_step)
    young, force = modulus(design), force_curve(design, solved, depth_schedule_mm(deepest))
    stated, tip = published_load(design), tip_of(design.indenter)
    outline = tip.points(np.linspace(0.0, TIP_LENGTH, TIP_POINTS))
    return PressView(
        design=design,
        press=press or solved.at(depth_mm),
        tip_mm=(outline[0] * solved.tip_radius_mm, outline[1] * solved.tip_radius_mm),
        young=young,
        force=force,
        pressure=contact_pressure(solved, depth_mm),
        comparison=compared(stated, force, young.value) if stated and stated.depth_mm <= deepest else None,
        driven=_driven(design, protocol, driven, solved.force_n) if protocol and driven else None,
        warnings=contact_notes(design),
    )


def _driven(
    design: SensorDesign, name: str, protocol: LoadProtocol, elastic_n: Callable[[float], float]
) -> ProtocolView:
    solid = solid_of(design)
    history = load_history(protocol, elastic_n, solid)
    return ProtocolView(name=name, protocol=protocol, history=history, is_elastic=solid is None)


def view_lines(view: PressView) -> list[str]:
    """Text about the press, a few lines, the most important first."""
    press, (height_mm, at_mm) = view.press, view.pile_up_mm
    peak = view.pressure.peak_mpa
    pressed = "not resolved by the mesh" if peak is None else f"{peak:.3g} MPa"
    deepest = float(view.force.depth_mm[-1])
    lines = [
        f"press     {press.depth_mm:g} mm: {_load(view, press.force_n, *view.band_n)}",
        f"contact   radius {press.contact_radius_mm:.2f} mm; peak pressure {pressed}",
        f"pile-up   {height_mm * 1000:.0f} um at {at_mm:.1f} mm from the axis",
        f"deepest   {deepest:g} mm: {_load(view, *view.force.at(deepest))}",
    ]
    if view.comparison is not None:
        lines.append(f"stated    {view.comparison.stated.source}")
        lines.append(f"          {view.comparison.words}")
    if view.driven is not None:
        lines += _protocol_lines(view.driven)
    return lines + [f"warning   {note}" for note in view.warnings]


def _load(view: PressView, force_n: float, low_n: float, high_n: float) -> str:
    young = view.young
    if not view.force.has_band:
        return f"{force_n:.2f} N at a modulus of {young.value:.3g} MPa ({young.confidence})"
    return (
        f"{force_n:.2f} N ({low_n:.2f} to {high_n:.2f} N over the modulus's band, {young.low:.3g} to "
        f"{young.high:.3g} MPa, {young.confidence})"
    )


def _protocol_lines(driven: ProtocolView) -> list[str]:
    protocol, history = driven.protocol, driven.history
    steps = protocol.steps
    inward, outward = history.pause_ends[:steps], history.pause_ends[steps - 1 :][::-1]
    lines = [
        f"protocol  {protocol.title}",
        f"          speed {protocol.speed_mm_per_s.value:g} mm/s ({protocol.speed_mm_per_s.confidence}: "
        f"{protocol.speed_mm_per_s.source})",
        "          depth [mm]  load after the pause [N], in / out",
    ]
    for going_in, coming_out in zip(inward, outward[1:], strict=True):
        lines.append(
            f"          {history.depth_mm[going_in]:10g}  {history.load_n[going_in]:.2f} / "
            f"{history.load_n[coming_out]:.2f}"
        )
    if driven.is_elastic:
        return [*lines, f"          {HOW_TO_RELAX}"]
    return [*lines, f"          work dissipated in the pad {history.lost_mj:.3g} mJ"]


def view_json(view: PressView) -> dict[str, Any]:
    """Data about the press for JSON; unknown values are None."""
    press, force, pressure = view.press, view.force, view.pressure
    return {
        "name": view.design.name,
        "digest": view.design.digest,
        "depth_mm": press.depth_mm,
        "force_n": press.force_n,
        "force_band_n": list(view.band_n) if force.has_band else None,
        "contact_radius_mm": press.contact_radius_mm,
        "pile_up_mm": dict(zip(("height", "radius"), view.pile_up_mm, strict=True)),
        "radius_mm": press.radius_mm.tolist(),
        "height_mm": press.height_mm.tolist(),
        "modulus_mpa": view.young.model_dump(mode="json"),
        "pressure": {
            "radius_mm": pressure.radius_mm.tolist(),
            "pressure_mpa": pressure.pressure_mpa.tolist(),
            "peak_mpa": pressure.peak_mpa,
            "is_resolved": pressure.is_resolved,
        },
        "curve": {
            "depth_mm": force.depth_mm.tolist(),
            "force_n": force.force_n.tolist(),
            "low_n": force.low_n.tolist(),
            "high_n": force.high_n.tolist(),
            "contact_radius_mm": force.contact_radius_mm.tolist(),
        },
        "stated": None if view.comparison is None else _comparison_json(view.comparison),
        "protocol": None if view.driven is None else _protocol_json(view.driven),
        "warnings": list(view.warnings),
    }


def _comparison_json(comparison: LoadComparison) -> dict[str, Any]:
    return {
        "depth_mm": comparison.stated.depth_mm,
        "stated_n": comparison.stated.force_n,
        "source": comparison.stated.source,
        "computed_n": comparison.force_n,
        "computed_band_n": [comparison.low_n, comparison.high_n],
        "miss": comparison.miss,
        "is_in_band": comparison.is_in_band,
        "needed_modulus_mpa": comparison.needed_modulus_mpa,
    }


def _protocol_json(driven: ProtocolView) -> dict[str, Any]:
    history = driven.history
    return {
        "name": driven.name,
        **driven.protocol.model_dump(mode="json"),
        "is_elastic": driven.is_elastic,
        "note": HOW_TO_RELAX if driven.is_elastic else None,
        "time_s": history.time_s.tolist(),
        "path_mm": history.depth_mm.tolist(),
        "load_n": history.load_n.tolist(),
        "elastic_n": history.elastic_n.tolist(),
        "has_left": history.has_left.tolist(),
        "pause_ends": history.pause_ends.tolist(),
        "lost_mj": history.lost_mj,
    }


def view_plots(view: PressView) -> dict[str, Axes]:
    """Pictures of the press by name; drawing and exporting must be inside the context `plain_style`."""
    from optopad.sims.plots.contact import (
        plot_force,
        plot_force_near,
        plot_load_over_time,
        plot_load_protocol,
        plot_pressure,
        plot_profile,
    )

    measured = [] if view.comparison is None else [view.comparison.stated.point]
    bend = mean_crown(view.design)
    crown_mm = view.press.tip_radius_mm / bend if bend else None
    plots = {
        "profile": plot_profile(view.press, view.tip_mm, crown_radius_mm=crown_mm),
        "force": plot_force(view.force, view.young, measured=measured),
        "pressure": plot_pressure(view.pressure),
    }
    if view.comparison is not None:
        plots["force-near"] = plot_force_near(view.force, view.young, view.comparison.stated.point)
    if view.driven is not None:
        plots["protocol"] = plot_load_protocol(view.driven.history)
        plots["protocol-time"] = plot_load_over_time(view.driven.history)
    return plots


def write_pictures(view: PressView, out: Path, *, seed: int) -> list[Path]:
    """Write the pictures as SVG and PNG into the design's bundle; returns their paths.

    Parameters
    ----------
    out : folder that contains the bundles
    seed : number stored in the manifest; nothing here is random

    Raises
    ------
    DesignError : the design breaks a rule; nothing is written
    OutputError : the folder cannot be written; an earlier bundle is intact
    """
    from optopad.plot_files import write_plot
    from optopad.sims.plots.style import plain_style

    require_valid(view.design)
    names = []
    with bundle(view.design, out, seed=seed) as folder, plain_style():
        (folder / "sims").mkdir(exist_ok=True)
        for stale in (folder / "sims").glob(f"{PREFIX}*"):
            stale.unlink()
        for name, axes in view_plots(view).items():
            figure = axes.get_figure(root=True)
            assert figure is not None
            names += [file.name for file in write_plot(figure, folder / "sims" / f"{PREFIX}{name}")]
    return [out / bundle_name(view.design) / "sims" / name for name in names]
