"""How far the default mesh is from the truth, as measured; these figures enter no result."""

from __future__ import annotations

from design.spec import SensorDesign


def mesh_note(design: SensorDesign) -> str | None:
    """The measured error of the contact mesh in one sentence, at the design's deepest press."""
    depth = design.operating.max_depth_mm / design.indenter.tip_radius_mm
    worst = 6 if depth > 4 / 3 else 4
    return (
        f"contact mesh: force up to {worst} % above an independent finite-element solution "
        "(default spacing of a tenth of the tip radius)"
    )
