"""Sections on the sensor: its pictures, its parts and materials, and whether the mold can be printed."""

from __future__ import annotations

import base64
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup

from optopad.design.mold.filling import is_cast_under_lid
from optopad.design.preset import true_description
from optopad.design.shape.cavity import cavity_of, plan_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.indenter import tip_words
from optopad.report.sections.drawings import Drawing
from optopad.report.words import part

MOLD_PNG, LID_PNG = "cad/mold.png", "cad/lid.png"
STATES = ("error", "warning", "ok")
"""States of the mold's checks, in the order in which the page lists them."""


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """Pictures of a bundle as data URLs (None if a file is missing), and whether x and y start at a corner."""

    mold: str | None
    wiring: str | None
    lid: str | None = None
    has_origin_corner: bool = True
    schematic: str | None = None
    orientation: str | None = None

    @property
    def addresses(self) -> tuple[str | None, ...]:
        """The data URLs of all pictures."""
        return self.mold, self.lid, self.orientation, self.wiring, self.schematic


def pictures_of(design: SensorDesign, folder: Path) -> Pictures:
    """Pictures of the mold and its lid, and the drawings of the build sheet."""
    return Pictures(
        mold=_png_address(folder / MOLD_PNG),
        lid=_png_address(folder / LID_PNG),
        has_origin_corner=plan_of(design).has_origin_corner,
        wiring=_svg_address(folder / "fabrication/wiring.svg"),
        schematic=_svg_address(folder / "fabrication/schematic.svg"),
        orientation=_svg_address(folder / "fabrication/orientation.svg"),
    )


def _png_address(png: Path) -> str | None:
    return _address("image/png", png.read_bytes()) if png.is_file() else None


def _svg_address(svg: Path) -> str | None:
    return _address("image/svg+xml", svg.read_bytes()) if svg.is_file() else None


def _address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def sensor_section(design: SensorDesign, drawings: dict[str, Drawing]) -> Markup:
    """The section on the sensor, with its dimensions."""
    cavity = cavity_of(design)
    by_angle = [one.angle_deg is not None for one in cavity.parts]
    return part(
        "sensor",
        design=design,
        description=true_description(design),
        drawing=drawings["layout"],
        cavity=cavity,
        any_by_angle=any(by_angle),
        all_by_angle=all(by_angle),
        any_along=any(one.angle_deg is None and not one.is_on_floor for one in cavity.parts),
        under_lid=is_cast_under_lid(cavity.plan),
        emitters=Counter((one.part_id, one.height_mm) for one in cavity.emitters),
        receivers=Counter((one.part_id, one.height_mm) for one in cavity.receivers),
        tip=tip_words(design.indenter),
    )


def checks_section(checks: dict[str, Any]) -> Markup:
    """The section with the mold's checks, failed ones first."""
    findings = sorted(checks.get("findings", []), key=lambda row: STATES.index(row["state"]))
    return part("checks", findings=findings, is_ok=checks.get("ok"))
