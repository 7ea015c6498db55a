"""The last sections: warnings, limits of the models, the bundle's files, the origin of the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign
from optopad.report.words import part
from optopad.sims.score.result import ContinuityScore

KNOWN_FILES = {
    "design.toml": "the effective design",
    "manifest.json": "digest, versions, seed, SHA-256 of every file",
    "report.html": "this page",
    "cad/mold.stl": "the mold, to slice",
    "cad/mold.step": "the mold, to edit",
    "cad/mold.3mf": "the mold, with units",
    "cad/mold_frame.stl": "the mold's walls, to slice",
    "cad/mold_base.stl": "the mold's floor, to slice",
    "cad/lid.stl": "the lid, which casts the crowned top",
    "cad/leveling_blade.stl": "levels the black layer",
    "cad/pour_gauge.stl": "shows when the clear layer is full",
    "cad/solder_jig.stl": "holds parts while wires are soldered",
    "cad/indenter_tip.stl": "the tip",
    "cad/checks.json": "mold checks",
    "sims/signals.nc": "light of every press of the map",
    "sims/maps.nc": "bounds, deadbands and readings of each location",
    "sims/bounds-location.svg": "resolution of location, by depth",
    "sims/bounds-depth.svg": "resolution of depth",
    "sims/felt-force.svg": "detection threshold",
    "sims/score.json": "the verdict as data",
    "sims/builds.svg": "Monte Carlo over tolerances",
    "sims/builds.png": "the same as pixels",
    "sims/contact-profile.svg": "the press, in section",
    "sims/rays.json": "sample paths of light, in a drawing of their own",
    "fabrication/bom.csv": "parts to order",
    "fabrication/wiring.csv": "pins",
    "fabrication/wiring.svg": "layout and pins, drawn",
    "fabrication/schematic.svg": "switches and amplifiers with their values",
    "fabrication/orientation.svg": "each kind of part in its place",
    "fabrication/casting.md": "how to cast it",
    "fabrication/driver.toml": "configuration of the driver",
    "fabrication/firmware/optopad.hex": "firmware, compiled",
    "fabrication/firmware/optopad/optopad.ino": "firmware: open it with the Arduino IDE",
    "fabrication/firmware/optopad/config.h": "the firmware's pins and settings",
}
WRITTEN_LAST = ("design.toml", "manifest.json", "report.html")
"""Files of every bundle that do not exist yet when the page is made."""


def bundle_files(folder: Path) -> list[str]:
    """Names of the bundle's files, including those written later, but not hidden files of work in progress."""
    found = {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts)
    }
    return sorted(found | set(WRITTEN_LAST), key=lambda name: (name.count("/"), name))


def closing_sections(
    design: SensorDesign, score: ContinuityScore, files: Sequence[str], seed: int, versions: dict[str, str]
) -> Markup:
    """The sections at the end of the page: warnings, limits of the models, links to files, origin of the numbers."""
    origin = (
        ("design", design.name),
        ("digest", design.digest),
        ("seed", str(seed)),
        ("map", "fine" if score.fine else "full" if score.full else "coarse"),
        ("versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
    )
    return part(
        "closing",
        score=score,
        design=design,
        is_block=plan_of(design).is_block,
        files=files,
        known_files=KNOWN_FILES,
        origin=origin,
    )
