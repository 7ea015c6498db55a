"""The one geometry: the cavity that is printed is the cavity that light travels in.

Frame: x and y from 0 at one cavity corner to the inner length and width; z = 0 at the bottom of
the clear layer, z = clear thickness at the undisturbed top. A part sits behind its wall: its
active face is flush with the inner face of the wall, its body reaches outward.

      z ^   rim            ......
        |  |      |        clear thickness (undisturbed top)
        |  |[body]|== active face, centre at height_mm
        |  |______|        0: bottom of the clear layer
        |  | black |       -black thickness
        |  | floor |       -black thickness - floor
"""

from __future__ import annotations

from dataclasses import dataclass

from design.errors import DesignError
from design.parts.catalog import Part
from design.shape.outline import Line, Outline, outline_in
from design.shape.plan import Plan, facet, plan_of
from design.spec import SensorDesign
from design.spec.fits import clearance_mm
from design.spec.layout import Kind, Placement, expand
from design.spec.properties import part_of


@dataclass(frozen=True, kw_only=True)
class PlacedPart:
    """A catalogue part at its place on a wall.

    Attributes
    ----------
    name, kind : E1 ..., emitter or receiver
    line : the flat wall that it sits in: of a disc a facet of its own
    along_mm, height_mm : centre of the active area along the wall and above the clear layer's bottom
    part_id, part : catalogue identifier and entry (measured values applied)
    clear_mm : height of the untouched top at the lower side of its active area, for what sticks out of it
    origin, height_field : dotted paths of the layout entry that placed it and of what gave its height
    angle_deg : direction of the facet that it has to itself in a round wall; None in a straight wall, which parts share
    """

    name: str
    kind: Kind
    line: Line
    along_mm: float
    height_mm: float
    part_id: str
    part: Part
    clear_mm: float
    origin: str
    height_field: str
    angle_deg: float | None = None

    @property
    def wall(self) -> str:
        """Name of its wall: south, east, north, west; of a disc its direction, as `45-degree`."""
        return self.line.name

    @property
    def half_width_mm(self) -> float:
        """Half of the active area along the wall [mm]."""
        return self.part.active_width_mm.value / 2

    @property
    def half_height_mm(self) -> float:
        """Half of the active area's height [mm]."""
        return self.part.active_height_mm.value / 2

    @property
    def lost_share(self) -> float:
        """Share of the active area above the undisturbed surface or below the clear layer [-]."""
        low, high = self.height_mm - self.half_height_mm, self.height_mm + self.half_height_mm
        inside = max(0.0, min(high, self.clear_mm) - max(low, 0.0))
        return 1.0 - inside / (high - low)

    @property
    def body_base_mm(self) -> float:
        """Height of the body's base above the clear layer's bottom; may be negative [mm]."""
        return self.height_mm - self.part.active_height_in_body_mm.value

    @property
    def body_top_mm(self) -> float:
        """Height of the body's top above the clear layer's bottom [mm]."""
        return self.body_base_mm + self.part.body_height_mm.value

    @property
    def position_mm(self) -> tuple[float, float, float]:
        """Centre of the active area in the cavity frame (x, y, z) [mm]."""
        return (*self.line.point(self.along_mm), self.height_mm)


@dataclass(frozen=True, kw_only=True)
class CavityGeometry:
    """Inner block, placed parts and workspace.

    Attributes
    ----------
    plan : outline and top
    black_mm : thickness of the black layer
    emitters, receivers : placed parts in the order of signals, states and pins
    workspace : allowed press centres
    tip_radius_mm : of the indenter, which decides what pairs a press can come between
    """

    plan: Plan
    black_mm: float
    emitters: tuple[PlacedPart, ...]
    receivers: tuple[PlacedPart, ...]
    workspace: Outline
    tip_radius_mm: float

    @property
    def length_mm(self) -> float:
        """Inner size along x [mm]."""
        return self.plan.length_mm

    @property
    def width_mm(self) -> float:
        """Inner size along y [mm]."""
        return self.plan.width_mm

    @property
    def clear_mm(self) -> float:
        """Thickness of the clear layer at its highest point [mm]."""
        return self.plan.clear_mm

    @property
    def parts(self) -> tuple[PlacedPart, ...]:
        """All placed parts, emitters first."""
        return self.emitters + self.receivers

    @property
    def volume_mm3(self) -> float:
        """Volume of the cavity up to the undisturbed top, both layers, without sockets [mm3]."""
        plan = self.plan
        if plan.is_block:
            return plan.length_mm * plan.width_mm * (plan.clear_mm + self.black_mm)
        return plan.clear_volume_mm3 + plan.area_mm2 * self.black_mm

    def wall_length_mm(self, wall: str) -> float:
        """Inner length of a flat wall [mm]."""
        return next(line.length_mm for line in self.plan.walls if line.name == wall)


def cavity_of(design: SensorDesign) -> CavityGeometry:
    """Lay out a design.

    Raises
    ------
    DesignError : a part that the catalogue does not have, or has as the other kind.
    """
    size = design.cavity
    bare = plan_of(design)
    placed = tuple(_placed(design, place, bare) for place in expand(design.layout, size))
    return CavityGeometry(
        plan=plan_of(design, [part.line for part in placed if part.line not in bare.walls]),
        black_mm=size.black_thickness_mm,
        emitters=tuple(part for part in placed if part.kind == "emitter"),
        receivers=tuple(part for part in placed if part.kind == "receiver"),
        workspace=workspace_of(design),
        tip_radius_mm=design.indenter.tip_radius_mm,
    )


def workspace_of(design: SensorDesign) -> Outline:
    """Press centres whose tip keeps the margin to every wall; empty in a pad that is too small."""
    size, inset = design.cavity, design.indenter.tip_radius_mm + design.operating.workspace_margin_mm
    return outline_in(size.outline, (inset, inset, size.length_mm - inset, size.width_mm - inset))


def part_field(place: Placement) -> str:
    """Dotted path that names a place's part: its own pattern, or its kind's section."""
    return f"{place.origin}.part" if place.part is not None else f"{place.kind}s.part"


def part_half_width_mm(design: SensorDesign, place: Placement) -> tuple[float, str]:
    """Half of a place's socket along its wall [mm], as wide as which a disc's facet is, and the part's identifier.

    Raises
    ------
    DesignError : a part that the catalogue does not have, or has as the other kind.
    """
    section = design.emitters if place.kind == "emitter" else design.receivers
    part_id = place.part or section.part
    body = part_of(design, part_id, place.kind).body_width_mm.value
    return body / 2 + clearance_mm(design.mold, part_id), part_id


def _placed(design: SensorDesign, place: Placement, bare: Plan) -> PlacedPart:
    section = design.emitters if place.kind == "emitter" else design.receivers
    part_id = place.part or section.part
    try:
        part = part_of(design, part_id, place.kind)
    except DesignError as err:
        raise DesignError(f"{part_field(place)}: {err}") from None
    line, along = next((wall for wall in bare.walls if wall.name == place.wall), None), place.along_mm
    if line is None:
        half = part_half_width_mm(design, place)[0]
        angle = place.angle_deg or 0.0
        line, along = facet(bare.outline.arc_towards(angle), angle, half), half
    return PlacedPart(
        name=place.name,
        kind=place.kind,
        line=line,
        along_mm=along,
        height_mm=section.height_mm if place.height_mm is None else place.height_mm,
        part_id=part_id,
        part=part,
        clear_mm=_top_over_mm(bare, line, along, part.active_width_mm.value / 2),
        origin=place.origin,
        height_field=f"{place.kind}s.height_mm" if place.height_mm is None else f"{place.origin}.height_mm",
        angle_deg=place.angle_deg,
    )


def _top_over_mm(bare: Plan, line: Line, along_mm: float, half_width_mm: float) -> float:
    """Height of the untouched top over an active area: at its lower side [mm]."""
    return min(bare.top_mm(*line.point(along_mm + side)) for side in (-half_width_mm, half_width_mm))
