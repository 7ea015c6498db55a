"""Is the file that goes to the printer the part that was meant, and can it be printed?

Checked on the STL as written, not on the solid: one closed body with consistent winding (trimesh
finds open seams that CAD kernels pass), a manifold by manifold3d, volume against the formula and
against the solid, size, faces that overhang, the cavity and a lid's dish against the optical model. Walls and webs
come from the parameters (`design.mold.webs`, `cad.lid_size`).
Left out: slicing, warping, how a given printer renders a thin wall.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import manifold3d
import numpy as np
import trimesh

from cad.lid_size import lid_clearances, lid_size
from cad.mesh import CHORD_LIMIT_MM, Mesh, read_stl, unit_normals
from cad.optical import cavity_agreement, dish_agreement
from cad.slicer import EXTRUDED_HIGH, EXTRUDED_LOW, Sliced, require_slicer, sliced
from cad.slicer import VOLUME_LIMIT as SLICER_VOLUME_LIMIT
from design.fields.units import ROUNDING_MM
from design.mold.lettering import OVERLAP
from design.mold.outline import outline_of
from design.mold.part_numbers import unnumbered
from design.mold.webs import bodies_above_rim, clearances, pockets_below_clear_layer, tightest
from design.parts.catalog import find_mold_material
from design.parts.printer import Bed, printer, usual_bed_mm
from design.shape.cavity import cavity_of
from design.shape.plan import plan_of
from design.spec import SensorDesign
from design.spec.properties import entries_of

State = Literal["ok", "warning", "error"]

VOLUME_LIMIT = 1e-3
"""Share of the volume that chords of round faces may take away."""
SOLID_LIMIT = 1e-6
"""The solid and the formula describe the same shape; only rounding is left."""
WALL_LIMIT_MM = 1e-4
"""Single-precision coordinates of a file, at sizes up to 400 mm: 3e-5 mm."""
OVERHANG_DEG = 45.0
"""Faces that lean out further than this from the vertical need support."""
THIN_LAYER_MM = 0.1
"""Of a finely printed lid: its steps in the dish, where they are not smoothed."""
OVERHANG_LIMIT_MM2 = 0.5
"""Area of overhang below which no support is worth the mark it leaves."""


@dataclass(frozen=True, kw_only=True)
class PartFile:
    """A printed part: its file's content and the two volumes to hold it against [mm3]."""

    name: str
    stl: bytes
    solid_mm3: float
    formula_mm3: float


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One measured value against its limit.

    Attributes
    ----------
    name : what was measured, with the part's name in front
    value, limit, unit : the measured value and what it has to be
    state : ok, warning (the part can be made) or error
    note : the place, or what to do
    """

    name: str
    value: float
    limit: float
    unit: str
    state: State
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Checks:
    """All findings of a design's printed parts.

    Attributes
    ----------
    digest : of the design
    findings : in the order of the parts
    volumes_mm3 : by part: `stl`, `solid` and `formula`
    prints : by part, where it was sliced: `minutes` and `filament_g`
    """

    digest: str
    findings: tuple[Finding, ...]
    volumes_mm3: dict[str, dict[str, float]]
    prints: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def is_ok(self) -> bool:
        """Whether nothing is in error; warnings are allowed."""
        return all(finding.state != "error" for finding in self.findings)

    def as_dict(self) -> dict[str, Any]:
        """Plain data for a file."""
        return {
            "ok": self.is_ok,
            "digest": self.digest,
            "volumes_mm3": self.volumes_mm3,
            **({"prints": self.prints} if self.prints else {}),
            "findings": [asdict(finding) for finding in self.findings],
        }


def check_parts(design: SensorDesign, parts: tuple[PartFile, ...], *, bed_mm: Bed | None = None) -> Checks:
    """Check every printed part of a design; the part named `mold` also as the optical cavity.

    Parameters
    ----------
    bed_mm : room of the printer, x, y and height; None for the usual one
    """
    bed, bridged = bed_mm or usual_bed_mm(), bridged_mm2(design)
    findings: list[Finding] = []
    volumes = {}
    for part in parts:
        loaded = trimesh.load_mesh(io.BytesIO(part.stl), file_type="stl")
        findings += _body(part.name, loaded) + _volumes(part, float(loaded.volume))
        findings += _printing(part.name, read_stl(part.stl), bed, bridged.get(part.name, 0.0))
        volumes[part.name] = {
            "stl": round(float(loaded.volume), 4),
            "solid": round(part.solid_mm3, 4),
            "formula": round(part.formula_mm3, 4),
        }
        if part.name == "mold":
            findings += _mold_size(design, loaded.extents) + _cavity(design, read_stl(part.stl))
        if part.name == "lid":
            findings.append(_dish(design, read_stl(part.stl)))
    return Checks(digest=design.digest, findings=(*findings, *design_findings(design)), volumes_mm3=volumes)


def with_slices(
    checks: Checks, design: SensorDesign, parts: tuple[PartFile, ...], bed_mm: Bed | None
) -> Checks:
    """The same with the slicer's opinion of every part that is printed.

    Raises
    ------
    InputError : no slicer on this machine.
    """
    density = find_mold_material(entries_of(design), design.mold.material).density_g_per_cm3.value
    room, program = bed_mm or usual_bed_mm(), require_slicer()
    findings, prints = list(checks.findings), {}
    for part in parts:
        if part.name == "mold" and design.mold.pieces != "one":
            continue
        one = sliced(part.stl, density_g_per_cm3=density, bed_mm=room, command=program)
        findings += _slicing(part, one)
        prints[part.name] = {"minutes": round(one.minutes, 1), "filament_g": round(one.filament_g, 2)}
    return replace(checks, findings=tuple(findings), prints=prints)


def _slicing(part: PartFile, one: Sliced) -> list[Finding]:
    """The slicer's volumes against ours, and its warnings."""
    ratio = one.extruded_mm3 / part.formula_mm3
    is_whole = EXTRUDED_LOW <= ratio <= EXTRUDED_HIGH
    return [
        _exact(f"{part.name}: manifold to the slicer", int(one.is_manifold), 1, "yes"),
        _at_most(
            f"{part.name}: volume in the slicer against the formula",
            round(abs(one.volume_mm3 / part.formula_mm3 - 1), 6),
            SLICER_VOLUME_LIMIT,
            "share",
        ),
        Finding(
            name=f"{part.name}: extruded by a solid print",
            value=round(ratio, 4),
            limit=EXTRUDED_HIGH if ratio > 1 else EXTRUDED_LOW,
            unit="share",
            state="ok" if is_whole else "warning",
            note="" if is_whole else "thin walls are dropped or doubled; see mold.min_web_mm",
        ),
        Finding(
            name=f"{part.name}: warnings of the slicer",
            value=len(one.warnings),
            limit=0,
            unit="warnings",
            state="warning" if one.warnings else "ok",
            note="; ".join(one.warnings),
        ),
    ]


def design_findings(design: SensorDesign) -> tuple[Finding, ...]:
    """Findings that need no solid: the tightest clearance of each kind, and notes on tall bodies."""
    webs = [
        Finding(
            name=f"mold: {one.name}",
            value=round(one.value_mm, 4),
            limit=one.needed_mm,
            unit="mm",
            state="ok" if one.is_kept else "error",
            note=one.where,
        )
        for one in tightest(clearances(design))
    ]
    tall, deep = bodies_above_rim(design), pockets_below_clear_layer(design)
    return (
        *webs,
        *_lid(design),
        *_lettering(design),
        _count("bodies above the rim", tall, "in the way of the leveling blade; raise mold.rim_mm"),
        _count("pockets below the clear layer", deep, "the black layer flows against these bodies"),
    )


def _lid(design: SensorDesign) -> Iterator[Finding]:
    """What is thinnest of a lid, and how its dish becomes smooth enough for light."""
    for one in lid_clearances(design):
        state: State = "ok" if one.is_kept else "warning"
        note = "" if one.is_kept else f"raise {one.field}; dowels in the fixing holes do a pin's work"
        yield Finding(
            name=f"lid: {one.name}",
            value=round(one.value_mm, 4),
            limit=one.needed_mm,
            unit="mm",
            state=state,
            note=note,
        )
    size = lid_size(design)
    if size is None:
        return
    cavity = cavity_of(design)
    clear, black = (
        volume / 1e3 for volume in (cavity.plan.clear_volume_mm3, cavity.plan.area_mm2 * cavity.black_mm)
    )
    straight = cavity.plan.top.straight
    turned = straight is not None and any(notch.frame.is_facet for notch in size.notches)
    yield Finding(
        name="lid: steps of layers in the dish, as printed",
        value=THIN_LAYER_MM,
        limit=0.0,
        unit="mm",
        state="warning",
        note="they become haze on the crown: print it dish up in layers of 0.1 mm, then fill and wet-sand the dish, or "
        "smooth ABS in vapour; or lay a formed film of 0.1 to 0.2 mm PET into it, which makes the layer that much "
        f"thinner. Filled upside down: {clear:.2f} cm3 clear, then {black:.2f} cm3 black"
        + (f". On the round mold its notches lie along {straight}" if turned else ""),
    )


def _lettering(design: SensorDesign) -> Iterator[Finding]:
    """Narrowest strokes and gaps of what is to be read, the widest bridge, and names without room."""
    outline, narrowest = outline_of(design), printer("narrowest_stroke").value
    widths = {"numbers": [one.stroke_mm for one in outline.numbers]}
    widths["label"] = [outline.label.stroke_mm] if outline.label.strokes else []
    for what, strokes in widths.items():
        if strokes:
            yield _at_least(f"mold: narrowest stroke of the {what}", min(strokes), narrowest)
            gap = min(strokes) / OVERLAP * (2 - OVERLAP)
            yield _at_least(f"mold: narrowest gap of the {what}", gap, narrowest)
    spans = [s.channel.along1 - s.channel.along0 for s in outline.sockets if s.channel is not None]
    if spans:
        longest = printer("longest_bridge").value
        yield _at_most(
            "mold: widest bridge over a lead channel", round(max(spans), 4), longest, "mm", "", "warning"
        )
    names = tuple(socket.part.name for socket in outline.sockets)
    missing = () if design.mold.numbers == "none" else tuple(unnumbered(names, outline.numbers))
    no_room = "no room below their sockets, in a parted mold on the frame; mark them by hand"
    yield _count("parts without their name on the mold", missing, no_room)
    radial = [s for s in outline.sockets if s.holes and s.channel is None]
    bare = tuple(s.part.name for s in radial) if design.mold.strain_relief == "pinch" else ()
    yield _count("leads without a channel below the mold", bare, "stand the mold on feet; see mold.floor_mm")


def _at_least(name: str, value: float, limit: float) -> Finding:
    state: State = "ok" if value >= limit - ROUNDING_MM else "error"
    return Finding(name=name, value=round(value, 4), limit=limit, unit="mm", state=state)


def _count(name: str, parts: tuple[str, ...], meaning: str) -> Finding:
    note = f"{', '.join(parts)}: {meaning}" if parts else ""
    return Finding(
        name=f"mold: {name}",
        value=len(parts),
        limit=0,
        unit="parts",
        state="warning" if parts else "ok",
        note=note,
    )


def _exact(name: str, value: float, wanted: float, unit: str, note: str = "") -> Finding:
    return Finding(
        name=name,
        value=value,
        limit=wanted,
        unit=unit,
        state="ok" if value == wanted else "error",
        note=note,
    )


def _at_most(
    name: str, value: float, limit: float, unit: str, note: str = "", beyond: State = "error"
) -> Finding:
    return Finding(
        name=name, value=value, limit=limit, unit=unit, state="ok" if value <= limit else beyond, note=note
    )


def _body(name: str, loaded: trimesh.Trimesh) -> list[Finding]:
    mesh = manifold3d.Mesh(
        np.asarray(loaded.vertices, dtype=np.float32), np.asarray(loaded.faces, dtype=np.uint32)
    )
    status = manifold3d.Manifold(mesh).status()
    is_manifold = status == manifold3d.Error.NoError
    return [
        _exact(f"{name}: watertight", int(loaded.is_watertight), 1, "yes"),
        _exact(f"{name}: consistent winding", int(loaded.is_winding_consistent), 1, "yes"),
        _exact(f"{name}: bodies", int(loaded.body_count), 1, "bodies"),
        _exact(f"{name}: manifold", int(is_manifold), 1, "yes", "" if is_manifold else status.name),
    ]


def _volumes(part: PartFile, stl_mm3: float) -> list[Finding]:
    return [
        _at_most(
            f"{part.name}: volume of the file against the formula",
            round(abs(stl_mm3 / part.formula_mm3 - 1), 9),
            VOLUME_LIMIT,
            "share",
        ),
        _at_most(
            f"{part.name}: volume of the solid against the formula",
            round(abs(part.solid_mm3 / part.formula_mm3 - 1), 9),
            SOLID_LIMIT,
            "share",
        ),
    ]


def bridged_mm2(design: SensorDesign) -> dict[str, float]:
    """Area of the ceilings that bridge, by part: strokes of label and numbers, the leads' channels [mm2]."""
    outline = outline_of(design)
    channels = [(s.channel, s.holes) for s in outline.sockets if s.channel is not None]
    below = outline.label.area_mm2 + sum(
        (cut.along1 - cut.along0) * (cut.out1 - cut.out0) - sum(math.pi * hole.radius**2 for hole in holes)
        for cut, holes in channels
    )
    numbers = sum(number.ceiling_mm2 for number in outline.numbers)
    return {"mold": below + numbers, "mold_base": below, "mold_frame": numbers}


def _printing(name: str, mesh: Mesh, bed_mm: Bed, bridged: float) -> list[Finding]:
    """The ceilings of strokes and channels bridge: their area is no overhang."""
    size = np.ptp(mesh.vertices, axis=0)
    fits = max(size[:2]) <= max(bed_mm[:2]) and min(size[:2]) <= min(bed_mm[:2]) and size[2] <= bed_mm[2]
    return [
        _at_most(
            f"{name}: overhang",
            round(overhang_area_mm2(mesh), 3),
            round(OVERHANG_LIMIT_MM2 + bridged, 3),
            "mm2",
            "faces that lean out further than 45 deg, above the bed"
            + (
                f"; {bridged:.1f} of it are ceilings of strokes and channels, which bridge" if bridged else ""
            ),
            "warning",
        ),
        Finding(
            name=f"{name}: print bed",
            value=round(float(max(size[:2])), 3),
            limit=max(bed_mm[:2]),
            unit="mm",
            state="ok" if fits else "warning",
            note=f"{size[0]:.1f} x {size[1]:.1f} x {size[2]:.1f} mm in a room of "
            f"{bed_mm[0]:g} x {bed_mm[1]:g} x {bed_mm[2]:g} mm",
        ),
    ]


def overhang_area_mm2(mesh: Mesh) -> float:
    """Area of faces above the bed that lean out by more than `OVERHANG_DEG` from the vertical [mm2]."""
    corners = mesh.corners
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    lean = np.degrees(np.arcsin(np.clip(-unit_normals(mesh)[:, 2], -1.0, 1.0)))
    above_bed = corners[:, :, 2].max(axis=1) > corners[:, :, 2].min() + WALL_LIMIT_MM
    return float(areas[above_bed & (lean > OVERHANG_DEG + 1e-3)].sum())


def _mold_size(design: SensorDesign, extents: np.ndarray[Any, Any]) -> list[Finding]:
    outline = outline_of(design)
    wanted = (design.mold.outer_length_mm, design.mold.outer_width_mm, outline.highest_mm - outline.bottom_mm)
    return [
        _at_most(
            "mold: outer size against the design",
            round(float(np.abs(extents - wanted).max()), 6),
            CHORD_LIMIT_MM if outline.outer.arcs else WALL_LIMIT_MM,
            "mm",
            " x ".join(f"{side:.2f}" for side in extents),
        )
    ]


def _cavity(design: SensorDesign, mesh: Mesh) -> list[Finding]:
    agreement = cavity_agreement(design, mesh)
    flat = _at_most(
        "mold: cavity walls against the optical model",
        round(agreement.worst_mm, 6),
        WALL_LIMIT_MM,
        "mm",
        f"{agreement.compared} rays from inside; {agreement.windows} more leave through sockets",
    )
    if not plan_of(design).outline.arcs:
        return [flat]
    worst = round(agreement.worst_round_mm, 6)
    return [
        flat,
        _at_most("mold: round wall against the optical model", worst, CHORD_LIMIT_MM, "mm", "chords"),
    ]


def _dish(design: SensorDesign, mesh: Mesh) -> Finding:
    agreement = dish_agreement(design, mesh)
    return _at_most(
        "lid: dish against the top of the optical model",
        round(agreement.worst_mm, 6),
        CHORD_LIMIT_MM,
        "mm",
        f"{agreement.compared} rays upward from the pad; chords",
    )
