"""Writes plots as files: SVG for pages and print, with searchable text, and PNG for programs that cannot read SVG."""

from __future__ import annotations

import io
from pathlib import Path

from matplotlib.figure import Figure

from optopad.design.files import write_whole
from optopad.design.io import write_text_atomically
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.sims.bounds.observability import PadBounds
from optopad.sims.plots.maps import plot_bound_sheet, plot_detection_map
from optopad.sims.plots.style import plain_style, svg_text

PNG_DPI = 160


def write_plot(figure: Figure, stem: Path) -> tuple[Path, Path]:
    """Write ``<stem>.svg`` and ``<stem>.png``, and return both paths; must be called inside `plain_style`."""
    svg, png = (stem.with_name(f"{stem.name}.{kind}") for kind in ("svg", "png"))
    write_text_atomically(svg, svg_text(figure, stem.name))
    figure.set_layout_engine("none")  # the layout was made for the SVG and must not change
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=PNG_DPI, metadata={"Software": None})
    write_whole(png, buffer.getvalue())
    return svg, png


def write_bound_plots(design: SensorDesign, bounds: PadBounds, folder: Path) -> list[Path]:
    """Plot the bounds of location and depth over depth, and the detection threshold; return both files' paths."""
    cavity = cavity_of(design)
    written: list[Path] = []
    with plain_style():
        written += write_plot(plot_bound_sheet(bounds, cavity, "location"), folder / "bounds-location")
        written += write_plot(plot_bound_sheet(bounds, cavity, "depth"), folder / "bounds-depth")
        if bounds.detection is not None:
            figure = plot_detection_map(bounds.detection, cavity).get_figure(root=True)
            assert figure is not None
            written += write_plot(figure, folder / "felt-force")
    return written
