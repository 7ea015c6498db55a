"""The last sections: warnings, limits of the models, the bundle's files, the origin of the numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from optopad.design.shape.cavity import plan_of
from optopad.design.spec import SensorDesign
from optopad.report.words import Html, bullets, element, facts, section
from optopad.sims.score.result import ContinuityScore

WALLS = (
    "The effect of the pad's walls on a press is modelled as one linear correction of the pad's size: "
    "the error of single pairs is 0.5 % rms down to 3 mm of depth and 1.2 % at 4.5 mm, most near a wall."
)
SHAPED_WALLS = (
    "A press is modelled as one in the middle of a round pad of the local thickness, on a sphere of the "
    "top's mean curvature. Left out: a nearer wall on one side, the thinning of the layer towards the "
    "rim, and the difference of a cylinder's two curvatures."
)
"""Model limits for discs and crowned pads."""
LEFT_OUT = (
    "Contact is static, axisymmetric and frictionless: no sliding, no adhesion, no slow bonding and detaching at the "
    "walls. Hysteresis of the load is an option for one protocol and never enters the light.",
    WALLS,
    "One tip, a rigid body of revolution with a straight shank. Several touches at once are not modelled.",
    "Light that leaves through the top is lost: none comes back in across the crater.",
    "Receivers are bare active areas, without package, lens or filter. Emitters are flat and even, with intensity "
    "falling as a power of the cosine; real packages shape their beam.",
    "One wavelength, one refractive index; no haze, no polarisation. Walls, bottom and tip scatter evenly in all "
    "directions; gloss is left out.",
    "Noise is rounding, a constant and a share of the reading. Drift, ambient light, crosstalk and "
    "limits of the amplifier are left out; a gain by a rule assumes equally bright emitters.",
    "The uncertainty bands are varied one value at a time; several deviations together can have a larger "
    "effect. optopad score --tolerance runs a Monte Carlo over all tolerances.",
    "Between computed depths and locations, signals are interpolated linearly or not at all.",
)

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
    "fabrication/orientation.svg": "each kind of part in its socket",
    "fabrication/casting.md": "how to cast it",
    "fabrication/driver.toml": "configuration of the driver",
    "fabrication/firmware/optopad.hex": "firmware, compiled",
    "fabrication/firmware/optopad/optopad.ino": "firmware: open it with the Arduino IDE",
    "fabrication/firmware/optopad/config.h": "the firmware's pins and settings",
}
WRITTEN_LAST = ("design.toml", "manifest.json", "report.html")
"""Files of every bundle that do not exist yet when the page is made."""


def warnings_section(score: ContinuityScore) -> Html:
    """The section with all warnings about the design and its verdict."""
    found = list(score.warnings)
    body = bullets(found, class_="warnings") if found else element("p", "None.")
    return section("warnings", "Warnings", body)


def limits_section(design: SensorDesign) -> Html:
    """The section on the models' limits: effects that no figure on the page includes."""
    is_plain = plan_of(design).is_block
    said = [SHAPED_WALLS if words is WALLS and not is_plain else words for words in LEFT_OUT]
    return section("limits", "What the models leave out", bullets(said))


def bundle_files(folder: Path) -> list[str]:
    """Names of the bundle's files, including those written later, but not hidden files of work in progress."""
    found = {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(folder).parts)
    }
    return sorted(found | set(WRITTEN_LAST), key=lambda name: (name.count("/"), name))


def files_section(names: Sequence[str]) -> Html:
    """The section with links to the bundle's files."""
    items = (
        element(
            "li",
            element("a", name, href=name),
            element("span", f" {KNOWN_FILES[name]}", class_="note") if name in KNOWN_FILES else "",
        )
        for name in names
    )
    return section(
        "files",
        "Files",
        element("p", "Links work while the page is in its bundle.", class_="note"),
        element("ul", *items, class_="files"),
    )


def origin_section(design: SensorDesign, score: ContinuityScore, seed: int, versions: dict[str, str]) -> Html:
    """The section on the origin of the page: design, seed, versions."""
    return section(
        "origin",
        "Where the numbers come from",
        facts(
            [
                ("design", design.name),
                ("digest", design.digest),
                ("seed", str(seed)),
                ("map", "fine" if score.fine else "full" if score.full else "coarse"),
                ("versions", ", ".join(f"{name} {version}" for name, version in versions.items())),
            ]
        ),
    )
