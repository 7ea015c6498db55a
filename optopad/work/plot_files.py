"""A figure as files: SVG with text for pages and print, PNG for everything that cannot read SVG."""

from __future__ import annotations

import io
import os
from pathlib import Path

from matplotlib.figure import Figure

from design.io import write_text_atomically
from sims.plots.style import svg_text

PNG_DPI = 160


def write_plot(figure: Figure, stem: Path) -> tuple[Path, Path]:
    """Write ``<stem>.svg`` and ``<stem>.png``; call it inside `plain_style`. Returns both paths."""
    svg, png = (stem.with_name(f"{stem.name}.{kind}") for kind in ("svg", "png"))
    write_text_atomically(svg, svg_text(figure, stem.name))
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=PNG_DPI, metadata={"Software": None})
    partial = png.with_name(f".{png.name}.partial")
    partial.write_bytes(buffer.getvalue())
    os.replace(partial, png)
    return svg, png
