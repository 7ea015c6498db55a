"""One centred press: surface, load, pressure, and the load over a protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from optopad.cli.verb import require_folder, typed, verb
from optopad.design.errors import InputError
from optopad.design.press_protocol import LoadProtocol, load_protocol
from optopad.design.progress import OnStep
from optopad.design.rules.check import require_valid
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import bundle, bundle_name
from optopad.screen.press import PressView, ProtocolView
from optopad.sims.contact.force_curve import compared, force_curve, published_load
from optopad.sims.contact.indentation import indent, solved_press
from optopad.sims.contact.load_protocol import load_history, solid_of
from optopad.sims.contact.pad_surface import contact_notes
from optopad.sims.contact.pressure import contact_pressure
from optopad.sims.contact.scope import contact_of
from optopad.sims.plots.contact import (
    plot_force,
    plot_force_near,
    plot_load_over_time,
    plot_load_protocol,
    plot_pressure,
    plot_profile,
)
from optopad.sims.plots.files import write_plot
from optopad.sims.plots.style import plain_style
from optopad.sims.press import depth_schedule_mm

TIP_POINTS = 400
TIP_LENGTH = 8.0
"""Length of the tip's outline in a picture [tip radii]; the outline has `TIP_POINTS` points."""
PREFIX = "contact-"


@verb(protocol=typed("NAME"), out=typed("FOLDER", type=Path, callback=require_folder), set_before="out")
def show(
    design: SensorDesign,
    *,
    depth: float = 2.0,
    protocol: str | None = None,
    out: Path | None = None,
    seed: int = 0,
    on_step: OnStep,
) -> PressView:
    """Compute load, surface and pressure of a centred press; with a protocol, also the load in retraction.

    Parameters
    ----------
    depth : Depth of the press [mm].
    protocol : Also the load over a load protocol: piacenza2017.
    out : Also write pictures, as SVG and PNG, into the bundle in this folder.
    """
    view = view_press(design, depth, protocol, on_step=lambda share: on_step("contact", share))
    return view if out is None else replace(view, files=_pictures(view, out, seed))


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
    contact = contact_of(design)
    contact.require_depth(depth_mm, "--depth")
    if driven is not None:
        contact.require_depth(driven.deepest_mm.value, f"--protocol {protocol}")
    press = indent(design, 0.0) if depth_mm == 0.0 else None
    deepest = max(depth_mm, design.operating.max_depth_mm, driven.deepest_mm.value if driven else 0.0)
    solved = solved_press(contact, deepest, on_step=on_step)
    young, force = contact.draft.modulus, force_curve(solved, depth_schedule_mm(deepest))
    stated, tip = published_load(design), contact.tip
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
        warnings=contact_notes(contact),
    )


def _driven(
    design: SensorDesign, name: str, protocol: LoadProtocol, elastic_n: Callable[[float], float]
) -> ProtocolView:
    solid = solid_of(design)
    history = load_history(protocol, elastic_n, solid)
    return ProtocolView(name=name, protocol=protocol, history=history, is_elastic=solid is None)


def _plots(view: PressView) -> dict[str, Axes]:
    """Pictures of the press by name; drawing and exporting must be inside the context `plain_style`."""
    measured = [] if view.comparison is None else [view.comparison.stated.point]
    bend = contact_of(view.design).mean_crown
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


def _pictures(view: PressView, out: Path, seed: int) -> tuple[Path, ...]:
    """Write the pictures as SVG and PNG into the design's bundle."""
    require_valid(view.design)
    names = []
    with bundle(view.design, out, seed=seed) as folder, plain_style():
        (folder / "sims").mkdir(exist_ok=True)
        for stale in (folder / "sims").glob(f"{PREFIX}*"):
            stale.unlink()
        for name, axes in _plots(view).items():
            figure = axes.get_figure(root=True)
            assert figure is not None
            names += [file.name for file in write_plot(figure, folder / "sims" / f"{PREFIX}{name}")]
    return tuple(out / bundle_name(view.design) / "sims" / name for name in names)
