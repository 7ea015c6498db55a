"""Checks files for printing: whether each file is the intended part, and whether the part can be printed.

The checks read the STL file as written, not the CAD solid. They check that

- the file is one closed body with consistent winding (trimesh finds open seams that CAD kernels miss) and a manifold
  (manifold3d)
- the volume of the file is that of the solid in the CAD kernel
- size and area of overhanging faces are within limits.

Widths of walls and webs are computed from the parameters (`optopad.design.mold.webs`, `optopad.cad.lid`), not from the
mesh. The checks do not cover warping or the quality of thin walls on a given printer. Slicing is optional
(`with_slices`).
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

from optopad.cad.lid import lid_clearances, lid_size
from optopad.cad.mesh import CHORD_LIMIT_MM, Mesh, read_stl, unit_normals
from optopad.cad.slicer import EXTRUDED_HIGH, EXTRUDED_LOW, Sliced, require_slicer, sliced
from optopad.cad.slicer import VOLUME_LIMIT as SLICER_VOLUME_LIMIT
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.mold.lettering import OVERLAP
from optopad.design.mold.outline import bodies_above_black, outline_of
from optopad.design.mold.part_numbers import unnumbered
from optopad.design.mold.webs import bodies_above_rim, clearances, pockets_below_clear_layer, tightest
from optopad.design.parts.assumptions import Bed, printer, usual_bed_mm
from optopad.design.parts.catalog import find_mold_material
from optopad.design.shape.cavity import cavity_of
from optopad.design.spec import SensorDesign
from optopad.design.spec.properties import entries_of

State = Literal["ok", "warning", "error"]

VOLUME_LIMIT = 1e-3
"""Limit of the relative volume difference between file and solid, which is mainly due to chords of round faces."""
WALL_LIMIT_MM = 1e-4
"""Limit of the deviation of flat walls; rounding to single precision causes up to 3e-5 mm at sizes up to 400 mm."""
OVERHANG_DEG = 45.0
"""Faces that overhang by more than this angle from the vertical need support."""
THIN_LAYER_MM = 0.1
"""Layer thickness of a fine print, which is the height of the steps in a lid's concave face before smoothing."""
SEAL_LIMIT = 1e-2
"""Limit of the relative difference of a frame's underside to the design, mainly due to chords of round edges."""
OVERHANG_LIMIT_MM2 = 0.5
"""Overhanging area up to which no support is recommended, because support leaves marks."""


@dataclass(frozen=True, kw_only=True)
class PartFile:
    """A part to print: the content of its STL file, and its volume by the CAD kernel [mm3]."""

    name: str
    stl: bytes
    solid_mm3: float


@dataclass(frozen=True, kw_only=True)
class MoldCheck:
    """Comparison of one measured value with its limit.

    Attributes
    ----------
    name : name of the part and of the measured value
    value, limit, unit : the measured value, its limit, and the unit of both
    state : result of the comparison: `ok`, `warning` (the part can still be made) or `error`
    note : position of the worst value, or advice; may be empty
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
    digest : hash of the design's content
    findings : findings in the order of the parts
    volumes_mm3 : for each part, its volumes `stl` and `solid`
    prints : for each sliced part, `minutes` and `filament_g`; empty without slicing
    """

    digest: str
    findings: tuple[MoldCheck, ...]
    volumes_mm3: dict[str, dict[str, float]]
    prints: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def is_ok(self) -> bool:
        """Whether no finding is an error; warnings are allowed."""
        return all(finding.state != "error" for finding in self.findings)

    def as_dict(self) -> dict[str, Any]:
        """The checks as plain data for a JSON file."""
        return {
            "ok": self.is_ok,
            "digest": self.digest,
            "volumes_mm3": self.volumes_mm3,
            **({"prints": self.prints} if self.prints else {}),
            "findings": [asdict(finding) for finding in self.findings],
        }


def check_parts(design: SensorDesign, parts: tuple[PartFile, ...], *, bed_mm: Bed | None = None) -> Checks:
    """Check every printed part of a design.

    Parameters
    ----------
    parts : the parts as written to their files
    bed_mm : build volume of the printer (x, y, height) for the size check; if None, that of a typical printer
    """
    bed, bridged = bed_mm or usual_bed_mm(), bridged_mm2(design)
    findings: list[MoldCheck] = []
    volumes = {}
    for part in parts:
        loaded = trimesh.load_mesh(io.BytesIO(part.stl), file_type="stl")
        findings += _body(part.name, loaded)
        findings.append(
            _at_most(
                f"{part.name}: volume of the file against the solid",
                round(abs(float(loaded.volume) / part.solid_mm3 - 1), 9),
                VOLUME_LIMIT,
                "share",
            )
        )
        findings += _printing(part.name, read_stl(part.stl), bed, bridged.get(part.name, 0.0))
        volumes[part.name] = {
            "stl": round(float(loaded.volume), 4),
            "solid": round(part.solid_mm3, 4),
        }
        if part.name == "mold":
            findings.append(_mold_size(design, loaded.extents))
            findings += _contact_with_board(design, read_stl(part.stl))
    return Checks(digest=design.digest, findings=(*findings, *design_findings(design)), volumes_mm3=volumes)


def with_slices(
    checks: Checks, design: SensorDesign, parts: tuple[PartFile, ...], bed_mm: Bed | None
) -> Checks:
    """The given checks with the slicer's findings about every printed part added.

    Raises
    ------
    InputError : no slicer is installed on this computer.
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


def _slicing(part: PartFile, one: Sliced) -> list[MoldCheck]:
    ratio = one.extruded_mm3 / part.solid_mm3
    is_whole = EXTRUDED_LOW <= ratio <= EXTRUDED_HIGH
    return [
        _exact(f"{part.name}: manifold to the slicer", int(one.is_manifold), 1, "yes"),
        _at_most(
            f"{part.name}: volume in the slicer against the solid",
            round(abs(one.volume_mm3 / part.solid_mm3 - 1), 6),
            SLICER_VOLUME_LIMIT,
            "share",
        ),
        MoldCheck(
            name=f"{part.name}: extruded by a solid print",
            value=round(ratio, 4),
            limit=EXTRUDED_HIGH if ratio > 1 else EXTRUDED_LOW,
            unit="share",
            state="ok" if is_whole else "warning",
            note="" if is_whole else "thin walls are dropped or doubled; see mold.min_web_mm",
        ),
        MoldCheck(
            name=f"{part.name}: warnings of the slicer",
            value=len(one.warnings),
            limit=0,
            unit="warnings",
            state="warning" if one.warnings else "ok",
            note="; ".join(one.warnings),
        ),
    ]


def design_findings(design: SensorDesign) -> tuple[MoldCheck, ...]:
    """Findings from the design's numbers alone: thinnest webs, lid, lettering, and bodies outside the clear layer."""
    outline = outline_of(design)
    webs = [
        MoldCheck(
            name=f"mold: {one.name}",
            value=round(one.value_mm, 4),
            limit=one.needed_mm,
            unit="mm",
            state="ok" if one.is_kept else "error",
            note=one.where,
        )
        for one in tightest(clearances(outline, design.mold))
    ]
    tall, deep = bodies_above_rim(outline), pockets_below_clear_layer(outline)
    return (
        *webs,
        *_lid(design),
        *(_on_board(design) if outline.is_frame else ()),
        *_lettering(design),
        _count("bodies above the rim", tall, "in the way of the leveling blade; raise mold.rim_mm"),
        _count("pockets below the clear layer", deep, "the black layer touches these bodies"),
    )


def _lid(design: SensorDesign) -> Iterator[MoldCheck]:
    """Findings about the thinnest parts of a lid, and about the optical smoothness of its concave face."""
    for one in lid_clearances(design):
        state: State = "ok" if one.is_kept else "warning"
        note = "" if one.is_kept else f"raise {one.field}; dowels in the fixing holes replace the pins"
        yield MoldCheck(
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
    black, clear = (volume / 1e3 for volume in cavity.layers_mm3)
    order = f"Filled upside down: {clear:.2f} cm3 clear, then {black:.2f} cm3 black"
    if design.is_on_board:
        order = f"{black:.2f} cm3 black on the board first; then filled upside down: {clear:.2f} cm3 clear"
    straight = cavity.plan.top.straight
    turned = straight is not None and any(notch.frame.is_facet for notch in size.notches)
    yield MoldCheck(
        name="lid: steps of layers in the dish, as printed",
        value=THIN_LAYER_MM,
        limit=0.0,
        unit="mm",
        state="warning",
        note="they become haze on the crown: print the lid dish up in layers of 0.1 mm, then fill and wet-sand the "
        "dish, or smooth ABS in vapour; or lay a formed film of 0.1 to 0.2 mm PET into it, which makes the "
        f"layer thinner by as much. {order}"
        + (f". On the round mold its notches are along {straight}" if turned else ""),
    )


def _on_board(design: SensorDesign) -> Iterator[MoldCheck]:
    """Findings about air that stays under parts on a circuit board, and about bodies in the way of a blade."""
    parts, board = cavity_of(design).on_floor, -design.cavity.black_thickness_mm
    raised = tuple(one.name for one in parts if one.body_base_mm > board + ROUNDING_MM)
    leaning = tuple(one.name for one in parts if one.is_leaning)
    yield _count(
        "parts above a gap to the board",
        raised,
        "air stays under them: close the gap with a drop of silicone and cure it before the first pour",
    )
    yield _count(
        "parts that lean over the board",
        leaning,
        "air stays under them: pour at the low side of the lean, then degas in the frame",
    )
    tall = bodies_above_black(design)
    if design.cavity.black_thickness_mm > 0 and tall:
        yield MoldCheck(
            name="mold: bodies above the black layer",
            value=len(tall),
            limit=0,
            unit="parts",
            state="ok",
            note="no leveling blade: the black layer is poured by weight around them, on a level table",
        )


def _contact_with_board(design: SensorDesign, mesh: Mesh) -> Iterator[MoldCheck]:
    """Finding about the flat underside of a frame, which seals on the circuit board; none for other molds."""
    outline = outline_of(design)
    if not outline.is_frame:
        return
    z, down = mesh.corners[:, :, 2], unit_normals(mesh)[:, 2] < -1.0 + 1e-6
    flat = mesh.corners[down & (z.max(axis=1) <= z.min() + WALL_LIMIT_MM)]
    area = np.linalg.norm(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]), axis=1).sum() / 2
    rounded = (1.0 - math.pi / 4) * 3 * outline.corner_radius_mm**2
    wanted = (
        outline.outer.area_mm2
        - rounded
        - outline.origin_cut_mm**2 / 2
        - outline.plan.area_mm2
        - sum(math.pi * hole.radius**2 for hole in outline.fixing_holes)
        - sum(one.size_mm * one.length_mm for one in outline.passages if one.z0 <= outline.bottom_mm)
    )
    yield _at_most(
        "mold: underside that seals on the board, against the design",
        round(abs(float(area) / wanted - 1.0), 6),
        SEAL_LIMIT,
        "share",
        f"{area:.1f} mm2; at least {_least_land_mm(design):.2f} mm wide: seal it with a bead of silicone or tape",
    )


def _least_land_mm(design: SensorDesign) -> float:
    """Least width of a frame's underside between the cavity and the outside or a fixing hole [mm]."""
    names = ("wall", "fixing hole to cavity")
    return min(one.value_mm for one in clearances(outline_of(design), design.mold) if one.name in names)


def _lettering(design: SensorDesign) -> Iterator[MoldCheck]:
    """Findings about strokes and gaps of the lettering, parts without a name, and channels for leads."""
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
    yield _count("leads without a channel below the mold", bare, "put the mold on feet; see mold.floor_mm")


def _at_least(name: str, value: float, limit: float) -> MoldCheck:
    state: State = "ok" if value >= limit - ROUNDING_MM else "error"
    return MoldCheck(name=name, value=round(value, 4), limit=limit, unit="mm", state=state)


def _count(name: str, parts: tuple[str, ...], meaning: str) -> MoldCheck:
    note = f"{', '.join(parts)}: {meaning}" if parts else ""
    return MoldCheck(
        name=f"mold: {name}",
        value=len(parts),
        limit=0,
        unit="parts",
        state="warning" if parts else "ok",
        note=note,
    )


def _exact(name: str, value: float, wanted: float, unit: str, note: str = "") -> MoldCheck:
    return MoldCheck(
        name=name,
        value=value,
        limit=wanted,
        unit=unit,
        state="ok" if value == wanted else "error",
        note=note,
    )


def _at_most(
    name: str, value: float, limit: float, unit: str, note: str = "", beyond: State = "error"
) -> MoldCheck:
    return MoldCheck(
        name=name, value=value, limit=limit, unit=unit, state="ok" if value <= limit else beyond, note=note
    )


def _body(name: str, loaded: trimesh.Trimesh) -> list[MoldCheck]:
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


def bridged_mm2(design: SensorDesign) -> dict[str, float]:
    """For each part, the area of ceilings over engraved strokes and lead channels, which a printer can bridge [mm2]."""
    outline = outline_of(design)
    channels = [(s.channel, s.holes) for s in outline.sockets if s.channel is not None]
    below = outline.label.area_mm2 + sum(
        (cut.along1 - cut.along0) * (cut.out1 - cut.out0) - sum(math.pi * hole.radius**2 for hole in holes)
        for cut, holes in channels
    )
    numbers = sum(number.ceiling_mm2 for number in outline.numbers)
    return {"mold": below + numbers, "mold_base": below, "mold_frame": numbers}


def _printing(name: str, mesh: Mesh, bed_mm: Bed, bridged: float) -> list[MoldCheck]:
    """Findings about overhanging area and print bed; `bridged` is the area of ceilings that need no support [mm2]."""
    size = np.ptp(mesh.vertices, axis=0)
    fits = max(size[:2]) <= max(bed_mm[:2]) and min(size[:2]) <= min(bed_mm[:2]) and size[2] <= bed_mm[2]
    return [
        _at_most(
            f"{name}: overhang",
            round(overhang_area_mm2(mesh), 3),
            round(OVERHANG_LIMIT_MM2 + bridged, 3),
            "mm2",
            "faces that overhang by more than 45 deg, above the bed"
            + (
                f"; {bridged:.1f} of it are ceilings of strokes and channels, which bridge" if bridged else ""
            ),
            "warning",
        ),
        MoldCheck(
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
    """Area of faces above the bed that overhang by more than `OVERHANG_DEG` from the vertical [mm2]."""
    corners = mesh.corners
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    lean = np.degrees(np.arcsin(np.clip(-unit_normals(mesh)[:, 2], -1.0, 1.0)))
    above_bed = corners[:, :, 2].max(axis=1) > corners[:, :, 2].min() + WALL_LIMIT_MM
    return float(areas[above_bed & (lean > OVERHANG_DEG + 1e-3)].sum())


def _mold_size(design: SensorDesign, extents: np.ndarray[Any, Any]) -> MoldCheck:
    outline = outline_of(design)
    wanted = (design.mold.outer_length_mm, design.mold.outer_width_mm, outline.highest_mm - outline.bottom_mm)
    return _at_most(
        "mold: outer size against the design",
        round(float(np.abs(extents - wanted).max()), 6),
        CHORD_LIMIT_MM if outline.outer.arcs else WALL_LIMIT_MM,
        "mm",
        " x ".join(f"{side:.2f}" for side in extents),
    )
