"""The maps of bounds as files of a bundle: SVG and PNG."""

from __future__ import annotations

from pathlib import Path

from design.geometry.cavity import cavity_of
from design.spec import SensorDesign
from optopad.work.plot_files import write_plot
from sims.bounds.observability import PadBounds
from sims.plots.bounds import plot_bound_sheet, plot_felt_map
from sims.plots.style import plain_style


def write_bound_plots(design: SensorDesign, bounds: PadBounds, folder: Path) -> list[Path]:
    """Location and depth bounds by depth, and the lightest press felt: ``bounds-*.svg`` and ``.png``; their paths."""
    cavity = cavity_of(design)
    written: list[Path] = []
    with plain_style():
        written += write_plot(plot_bound_sheet(bounds, cavity, "location"), folder / "bounds-location")
        written += write_plot(plot_bound_sheet(bounds, cavity, "depth"), folder / "bounds-depth")
        if bounds.felt is not None:
            figure = plot_felt_map(bounds.felt, cavity).get_figure(root=True)
            assert figure is not None
            written += write_plot(figure, folder / "felt-force")
    return written
