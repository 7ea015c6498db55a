"""Rules for the simulation of a design: active areas, light paths, workspace, press depth, materials and finish.

Rules of finish are about smooth walls, angular tables, parts with a lens, and round parts whose light would miss the
pad.

The elastic depth is the total thickness of the clear and the black layer. The contact model is valid for presses as
deep as 0.8 of the elastic depth, but no deeper than 1.7 tip radii. For deeper presses the verdict is
OUT_OF_MODEL_SCOPE, and the rule gives a warning. A press deeper than the clear layer is impossible and gives an error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from optopad.design.draft import Draft
from optopad.design.errors import DesignError
from optopad.design.fields.finding import FAILS, Finding, error, mm, outside_models, warning
from optopad.design.fields.quantity import ROUNDING_MM
from optopad.design.parts.angular import FLAT_FACE_LEAST_DEG
from optopad.design.parts.catalog import Part
from optopad.design.parts.spectrum import CURVES
from optopad.design.rules.shape import (
    CROWNED_LAYER_RANGE,
    LARGEST_SHARE_OF_LAYER,
    LAYER_DEPTH_RANGE,
    LEAST_PRESS_MM,
    LIBRARY_LAYER_RANGE,
    NEAREST_WALL,
    deepest_modelled_mm,
    deepest_of_tip,
    thinnest_elastic_mm,
)
from optopad.design.shape.cavity import (
    CavityGeometry,
    PlacedPart,
    beside_chord,
    direct_path_pairs,
    facing_pairs,
    is_facing_rows,
    pair_name,
)
from optopad.design.spec import properties
from optopad.design.spec.layout import FLOOR, MAX_PER_KIND, Kind

SURROUND_MM = 0.1
"""Offset of additional presses around a location [mm].

With these presses the verdict evaluates whether nearby locations can be distinguished.
"""
KINDS: tuple[Kind, Kind] = ("emitter", "receiver")


def count_findings(emitter_count: int, receiver_count: int) -> Iterator[Finding]:
    """Errors about a layout without emitters or receivers, or with too many of them."""
    for kind, count in zip(KINDS, (emitter_count, receiver_count), strict=True):
        if count == 0:
            yield error(
                "layout",
                f"the layout has no {kind}",
                value=0,
                limit=f"1 to {MAX_PER_KIND} {kind}s",
                way_out=f"add a pattern with {kind}s",
            )
        elif count > MAX_PER_KIND:
            yield error(
                "layout",
                f"the layout has too many {kind}s",
                value=count,
                limit=f"1 to {MAX_PER_KIND}",
                way_out="use fewer, or make two designs",
            )


def name_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    """Errors about duplicate names of parts, because signals, wiring and reports use the names as identifiers."""
    names = [part.name for part in cavity.parts]
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        origin = [part.origin for part in cavity.parts if part.name == name][-1]
        yield error(
            origin,
            f"{names.count(name)} parts have the name {name}",
            value=name,
            limit="a name for each part",
            way_out="rename one; parts without a name are called E1, E2 ... and R1, R2 ... in order",
        )


def area_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    """Findings about emitting or sensitive areas that are partly or wholly outside the clear layer."""
    seen: set[tuple[str, str, float]] = set()
    for part in (one for one in cavity.parts if not one.is_on_floor):
        key = (part.height_field, part.part_id, round(part.clear_mm, 9))
        if key not in seen:  # parts with the same key have the same finding
            seen.add(key)
            yield from _area_of(part, is_crowned=not cavity.plan.top.is_flat)


def path_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    """Findings about layouts without a direct light path, or with all emitters or receivers in one wall."""
    walls = {kind: sorted({p.wall for p in cavity.parts if p.kind == kind}) for kind in KINDS}
    if all(found == [FLOOR] for found in walls.values()):
        apart = [math.dist(e.position_mm, r.position_mm) for e in cavity.emitters for r in cavity.receivers]
        if not direct_path_pairs(cavity).any():
            yield error(
                "layout",
                "no emitter has a receiver near enough for light by way of the top",
                value=f"{mm(min(apart))} to the nearest",
                limit=f"at most {mm(cavity.reach_mm)}, {cavity.reach_mm / cavity.clear_mm:g} clear layers",
                way_out="bring emitters and receivers nearer to each other, or thicken the clear layer",
            )
        return
    if not direct_path_pairs(cavity).any():
        yield error(
            "layout",
            "no pair has a direct path: every emitter and every receiver is in the same wall",
            value=f"all on the {walls['emitter'][0]} wall",
            limit="emitters and receivers in different walls",
            way_out="put receivers at other angles, for example with pattern = 'disc_ring'"
            if not cavity.plan.outline.bare.lines
            else "put receivers on another wall, for example with pattern = 'facing_rows'",
        )
    elif not is_facing_rows(cavity):
        for kind in KINDS:
            if len(walls[kind]) == 1:
                yield warning(
                    "layout",
                    f"all {kind}s are in one wall, so a press is seen from one side",
                    value=f"all {kind}s on the {walls[kind][0]} wall",
                    limit="two walls or more",
                    way_out=f"spread the {kind}s over the walls, or accept a coarser depth and location",
                )


def workspace_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about a workspace that is empty, too near to the walls, or away from the judged pairs."""
    cavity = draft.cavity
    space, radius = cavity.workspace, draft.design.indenter.tip_radius_mm
    side = min(space.x1_mm - space.x0_mm, space.y1_mm - space.y0_mm)
    margin = draft.design.operating.workspace_margin_mm
    if space.is_empty:
        yield error(
            "operating.workspace_margin_mm",
            f"no location is left to press with a tip of radius {radius:g} mm",
            value=f"{margin:g} mm leave {mm(side)} for the tip's centre",
            limit="at least 0.00 mm",
            way_out="lower it, use a smaller indenter.tip_radius_mm, or enlarge the cavity",
        )
        return
    if 2 * radius > side + ROUNDING_MM:
        yield warning(
            "indenter.tip_radius_mm",
            "the tip is wider than the workspace that it moves in",
            value=f"a tip of {mm(2 * radius)} across",
            limit=f"at most the workspace's {mm(side)}",
            way_out="use a smaller tip or margin, or enlarge the cavity",
        )
    nearest = (NEAREST_WALL - 1.0) * radius + SURROUND_MM
    if margin < nearest - ROUNDING_MM:
        yield outside_models(
            "operating.workspace_margin_mm",
            "presses at its border are nearer to a wall than the contact model covers",
            value=mm(margin),
            limit=f"at least {mm(nearest)}: the axis {NEAREST_WALL:g} tip radii from a wall, and {SURROUND_MM:g} mm",
            way_out="raise it, or use a smaller indenter.tip_radius_mm",
        )
    yield from _off_chord_findings(cavity)
    yield from _middle_findings(cavity)


def depth_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about a layer outside the contact model's range, or a press too deep for the layer or the model."""
    yield from _layer_findings(draft) if draft.plan.top.is_flat else _crowned_layer_findings(draft)
    yield from _press_findings(draft)


def _crowned_layer_findings(draft: Draft) -> Iterator[Finding]:
    tip = draft.design.indenter.tip_radius_mm
    thickest = draft.design.cavity.elastic_mm
    low, high = (radii * tip for radii in CROWNED_LAYER_RANGE)
    thinnest = thinnest_elastic_mm(draft)
    if math.isnan(thinnest):
        return  # the crown does not reach the workspace's border, which another finding covers
    if not (low - ROUNDING_MM <= thinnest and thickest <= high + ROUNDING_MM):
        yield outside_models(
            "cavity.clear_thickness_mm",
            "both layers together are outside the contact model of crowned pads",
            value=f"{mm(thinnest)} at the border of the workspace, {mm(thickest)} at the highest point",
            limit=f"{mm(low)} to {mm(high)}: {CROWNED_LAYER_RANGE[0]:.3g} to {CROWNED_LAYER_RANGE[1]:g} tip radii",
            way_out="change it, cavity.black_thickness_mm or indenter.tip_radius_mm, or raise crown.radius_mm",
        )


def _layer_findings(draft: Draft) -> Iterator[Finding]:
    elastic, tip = thinnest_elastic_mm(draft), draft.design.indenter.tip_radius_mm
    thinnest, thickest = (radii * tip for radii in LAYER_DEPTH_RANGE)
    if not thinnest - ROUNDING_MM <= elastic <= thickest + ROUNDING_MM:
        yield outside_models(
            "cavity.clear_thickness_mm",
            "both layers together are outside the contact model",
            value=f"{mm(elastic)} elastic depth",
            limit=f"{mm(thinnest)} to {mm(thickest)}: {LAYER_DEPTH_RANGE[0]:g} to {LAYER_DEPTH_RANGE[1]:g} tip radii",
            way_out="change it, cavity.black_thickness_mm or indenter.tip_radius_mm",
        )
    elif (
        not LIBRARY_LAYER_RANGE[0] * tip - ROUNDING_MM
        <= elastic
        <= LIBRARY_LAYER_RANGE[1] * tip + ROUNDING_MM
    ):
        low, high = LIBRARY_LAYER_RANGE
        yield warning(
            "cavity.clear_thickness_mm",
            "both layers together are outside the contact library: solved live (minutes), not validated",
            value=f"{mm(elastic)} elastic depth",
            limit=f"{mm(low * tip)} to {mm(high * tip)}: {low:g} to {high:g} tip radii",
            way_out="change it, cavity.black_thickness_mm or indenter.tip_radius_mm, or measure the force on the pad",
        )


def _press_findings(draft: Draft) -> Iterator[Finding]:
    depth, clear = draft.design.operating.max_depth_mm, draft.design.cavity.clear_thickness_mm
    scope = deepest_modelled_mm(draft)
    if depth > clear - ROUNDING_MM:
        yield error(
            "operating.max_depth_mm",
            "the deepest press passes through the clear layer",
            value=f"{depth:g} mm",
            limit=f"less than cavity.clear_thickness_mm = {clear:g} mm",
            way_out="lower it, or thicken the layer",
        )
    elif depth < LEAST_PRESS_MM:
        yield outside_models(
            "operating.max_depth_mm",
            "the deepest press is less than a deadband's least length",
            value=f"{depth:g} mm",
            limit=f"at least {LEAST_PRESS_MM:g} mm",
            way_out="raise it",
        )
    elif depth > scope + ROUNDING_MM:
        yield outside_models(
            "operating.max_depth_mm",
            "the deepest press is outside the contact model",
            value=f"{depth:g} mm",
            limit=f"at most {mm(scope)}: {LARGEST_SHARE_OF_LAYER:g} x elastic depth and "
            f"{deepest_of_tip(draft.design.indenter):g} x tip radius",
            way_out="lower it, thicken the layers, use a larger indenter.tip_radius_mm"
            + (
                ", or a larger indenter.edge_radius_mm" if draft.design.indenter.shape == "flat_punch" else ""
            ),
        )


def material_findings(draft: Draft) -> Iterator[Finding]:
    """Errors about optical or elastic values that the catalogue's tables do not cover."""
    for field, name in (
        ("elastomer.refractive_index", "refractive_index"),
        ("elastomer.absorption_db_per_cm", "absorption_db_per_cm"),
        ("elastomer.youngs_modulus_mpa", "modulus"),
    ):
        try:
            getattr(draft, name)
        except DesignError as err:
            where, _, rest = str(err).partition(": ")
            what, _, way_out = rest.partition("; ")
            yield error(
                where if where == "elastomer.mixing_ratio" else "emitters.part",
                what,
                value=f"mixing_ratio {draft.design.elastomer.mixing_ratio:g}, {draft.design.emitters.part}",
                limit="a value inside the catalogue's table",
                way_out=way_out or f"give {field}",
            )


def colour_findings(draft: Draft) -> Iterator[Finding]:
    """Warnings about emitters whose wavelength differs from the default emitter's, which sets the refractive index."""
    default = properties.wavelength_um(draft.design) * 1000.0
    spectrum = properties.part_of(draft.design, draft.design.emitters.part, "emitter").spectrum
    others = {
        part.part_id: part
        for part in draft.cavity.emitters
        if part.part.wavelength_nm is not None
        and (abs(part.part.wavelength_nm.value - default) > 1e-6 or part.part.spectrum != spectrum)
    }
    for part_id, part in others.items():
        assert part.part.wavelength_nm is not None  # filtered above
        differs = "wavelength" if part.part.spectrum == spectrum else "spectrum"
        yield warning(
            part.origin,
            f"{part_id} has another {differs} than emitters.part, whose refractive index is used for all",
            value=f"{part.part.wavelength_nm.value:g} nm",
            limit=f"{default:g} nm",
            way_out="make it emitters.part, or compare both designs",
        )


def _area_of(part: PlacedPart, *, is_crowned: bool) -> Iterator[Finding]:
    low, high = part.height_mm - part.half_height_mm, part.height_mm + part.half_height_mm
    under = f"cavity.clear_thickness_mm = {part.clear_mm:g} mm"
    if is_crowned:
        under = f"the {mm(part.clear_mm)} that the crown leaves over it"
    area = "emitting area" if part.kind == "emitter" else "sensitive area"
    if part.height_mm > part.clear_mm + ROUNDING_MM:
        yield error(
            part.height_field,
            f"the centre of the {area} of {part.name} is above the undisturbed surface",
            value=f"{part.height_mm:g} mm",
            limit=f"at most {under}",
            way_out="lower the part or thicken the clear layer",
        )
    elif high > part.clear_mm + ROUNDING_MM:
        yield warning(
            part.height_field,
            f"the {area} of {part.name} reaches above the surface, which cuts off {part.lost_share:.0%} of the area",
            value=f"its upper edge at {mm(high)}",
            limit=f"at most {under} for the whole area",
            way_out="lower the part, thicken the clear layer, or accept the weaker signal",
        )
    if low < -ROUNDING_MM:
        yield error(
            part.height_field,
            f"the {area} of {part.name} sticks out below the clear layer",
            value=f"its lower edge at {mm(low)}",
            limit="at least 0.00 mm, the bottom of the clear layer",
            way_out=f"raise the part to {mm(part.half_height_mm)} or more (heights are in millimetres)",
        )


def _off_chord_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    beside = []
    for e, r in facing_pairs(cavity):
        x, y = _chord_middle_mm(cavity.emitters[e], cavity.receivers[r])
        cx, cy = cavity.workspace.clamped(x, y)
        shift = max(abs(cx - x), abs(cy - y))
        if shift > ROUNDING_MM:
            beside.append((shift, pair_name(cavity, (e, r))))
    if beside:
        yield warning(
            "operating.workspace_margin_mm",
            f"{', '.join(name for _, name in beside)} are judged by presses next to their chord, which the workspace "
            "does not reach",
            value=f"{mm(max(shift for shift, _ in beside))} from the chord",
            limit="a press on the chord",
            way_out="lower the margin, lower layout pitch_mm, or judge by the other pairs",
        )


def _middle_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    pairs = [(int(e), int(r)) for e, r in np.argwhere(direct_path_pairs(cavity))]
    if not pairs or is_facing_rows(cavity):
        return
    nearest = min(beside_chord(cavity, pair, cavity.plan.centre_mm)[0] for pair in pairs)
    if nearest > cavity.tip_radius_mm + ROUNDING_MM:
        yield warning(
            "layout",
            "no pair looks across the middle of the pad, so a light touch there is detected late",
            value=f"the nearest line from an emitter to a receiver is {mm(nearest)} from the middle",
            limit=f"at most the tip's radius, {mm(cavity.tip_radius_mm)}",
            way_out="put parts nearer to the middle"
            if cavity.on_floor
            else "use an odd count in a ring, or put a receiver opposite an emitter",
        )


def _chord_middle_mm(emitter: PlacedPart, receiver: PlacedPart) -> tuple[float, float]:
    ex, ey, _ = emitter.position_mm
    rx, ry, _ = receiver.position_mm
    return (ex + rx) / 2, (ey + ry) / 2


SHORT_TABLE_DEG = 80.0
"""Angle up to which an angular table should extend; a shorter one causes a warning [deg].

Beyond it a Lambertian source emits 3 % of its power.
"""


ROUND_LEAST = 0.95
"""Least ratio of both widths of a body that counts as round; a side-looking part is cut by a flat."""
LONG_LEAST = 1.15
"""Least ratio of length and width of a round body whose axis is recognised."""


def finish_findings(draft: Draft) -> Iterator[Finding]:
    """Findings about mirror-like walls: a missing or unused refractive index, or longer computation."""
    surfaces = draft.design.surfaces
    if surfaces.wall_index is not None and surfaces.wall_finish != "glossy":
        yield error(
            "surfaces.wall_index",
            f"surfaces.wall_finish is '{surfaces.wall_finish}', which has no use for an index",
            value=f"{surfaces.wall_index:g}",
            limit="no wall_index, or wall_finish = 'glossy'",
            way_out="remove it, or set surfaces.wall_finish = 'glossy'",
        )
    if surfaces.wall_finish != "diffuse":
        yield warning(
            "surfaces.wall_finish",
            "light that a wall mirrors is traced, not integrated: runs take longer, standard errors are larger",
            value=f"'{surfaces.wall_finish}'",
            limit="'diffuse' for the fastest run",
            way_out="keep it where the walls are smooth; read the standard errors",
        )
    if draft.design.mold.material in draft.entries.mold_materials:
        yield from _index_findings(draft)


def _index_findings(draft: Draft) -> Iterator[Finding]:
    try:
        _ = draft.wall_index  # raises an error without an index
    except DesignError as err:
        where, _, rest = str(err).partition(": ")
        what, _, way_out = rest.partition("; ")
        yield error(where, what, value="none", limit="an index of the wall, 1 to 2.5", way_out=way_out)


def angle_findings(cavity: CavityGeometry) -> Iterator[Finding]:
    """Findings about lenses, whose effect in elastomer is not modelled, and about angular tables that end early."""
    for placed in {part.part_id: part for part in cavity.parts}.values():
        yield from _lens_findings(placed.part, placed.part_id, placed.origin)
        yield from _table_findings(placed.part, placed.part_id, placed.origin)
        yield from _view_findings(placed.part, placed.part_id)
        yield from _junction_findings(placed.part, placed.part_id, placed.origin)


def _half_angle_deg(part: Part) -> float:
    table = part.angular_pattern if part.kind == "emitter" else part.angular_response
    return part.half_angle_deg.value if table is None else table.half_angle_deg()


def _lens_findings(part: Part, part_id: str, origin: str) -> Iterator[Finding]:
    half = _half_angle_deg(part)
    if half >= FLAT_FACE_LEAST_DEG or (part.kind == "receiver" and part.epoxy_index is None):
        return
    yield warning(
        origin,
        f"{part_id} has a lens, by its narrow half angle in air; bedded in elastomer a lens loses most of its power, "
        "which is not modelled",
        value=f"{half:g} deg",
        limit=f"{FLAT_FACE_LEAST_DEG:g} deg or more, as behind a flat face",
        way_out="choose a flat part, or measure the angles in elastomer and give them as a table",
    )


def _junction_findings(part: Part, part_id: str, origin: str) -> Iterator[Finding]:
    if part.kind == "receiver" and part.junction == "phototransistor":
        yield warning(
            origin,
            f"{part_id} is a phototransistor, and the amplifiers give it no voltage to work: light and mold are right, "
            "the circuit is not",
            value="0 V from collector to emitter",
            limit="a photodiode",
            way_out="use a photodiode, or another input circuit than that of the schematic",
            weight=FAILS,
        )


def _view_findings(part: Part, part_id: str) -> Iterator[Finding]:
    """Error about a round body that is entered as if its light left across its axis.

    A part's light leaves the wall horizontally. A round body that is longer than wide, as of a 5 mm LED, sends it along
    its length, away from its leads. A side-looking body is flat where its light leaves.
    """
    width, depth, height = (
        size.value for size in (part.body_width_mm, part.body_depth_mm, part.body_height_mm)
    )
    if part.view is not None:
        return
    has_lens = _half_angle_deg(part) < FLAT_FACE_LEAST_DEG
    if _is_round(width, depth, height) and (part.mounting == "radial" or has_lens):
        message = "a round body standing upright sends its light upward along its length, not into the pad"
        way_out = f"mounting = 'surface', body_depth_mm = {height:g}, body_height_mm = {depth:g}"
    elif part.mounting == "radial" and _is_round(width, height, depth):
        message = "the leads of a round body lying on its side leave through the wall's back, not downward"
        way_out = "mounting = 'surface'"
    else:
        return
    yield error(
        f"catalog.parts.{part_id}.mounting",
        f"{part_id}: {message}",
        value=f"'{part.mounting}', {width:g} x {depth:g} x {height:g} mm (width, depth into the wall, height)",
        limit="light that leaves the wall horizontally",
        way_out=f"lay it on its side: {way_out} (`optopad part new` writes such an entry); add view = 'side' if it is "
        "a side-looking part",
    )


def _is_round(one_mm: float, other_mm: float, length_mm: float) -> bool:
    """Whether a body has a square outline across its length, as a round body has, and is longer than wide."""
    narrow, wide = sorted((one_mm, other_mm))
    return narrow >= ROUND_LEAST * wide and length_mm >= LONG_LEAST * wide


def _table_findings(part: Part, part_id: str, origin: str) -> Iterator[Finding]:
    for name in ("angular_pattern", "angular_response"):
        table = getattr(part, name)
        if table is not None and table.last_deg < SHORT_TABLE_DEG:
            yield warning(
                origin,
                f"{name} of {part_id} ends early; beyond its last angle a linear fall to 0 at 90 deg is assumed",
                value=f"{table.last_deg:g} deg",
                limit=f"{SHORT_TABLE_DEG:g} deg or more",
                way_out="give the sheet's values further out",
            )
    for name in CURVES:
        table = getattr(part, name)
        if table is not None and table.adapted is not None:
            yield warning(
                origin,
                f"{name} of {part_id} was adapted, because a digitiser's points are no table",
                value=table.adapted,
                limit="rising points from 0",
                way_out="look at the digitised diagram",
            )
