r"""Collars: walls above the rim around the bodies that are taller than it, so that they are held to their top.

            body
         ___ | ___   collar, up to the body's top
        |   | |   |
    ____|   | |   |__  rim           neighbours closer than three webs share one collar
            | |
    cavity  |_|  pocket

A collar starts behind the pour lip and is a web thicker than its pockets on the other three sides; pocket and slots
stay open upward through it. None is built where it would meet a fixing hole: the body then stands free, as
`design.mold.webs.bodies_above_rim` tells.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from design.fields.units import ROUNDING_MM
from design.mold.sockets import Box, Cut, Hole, Socket, WallFrame
from design.spec import Mold
from design.spec.layout import WALLS

OWN_COLLAR_WEBS = 3
"""Neighbours this many webs apart have a collar each, with a web of air between."""


@dataclass(frozen=True, kw_only=True)
class Collar:
    """One collar: its wall and its block above the rim, pockets and slots not yet cut.

    Attributes
    ----------
    names : of the parts that it holds
    """

    names: tuple[str, ...]
    frame: WallFrame
    block: Cut

    @property
    def top_mm(self) -> float:
        """Level of its upper face [mm]."""
        return self.block.top

    @property
    def box(self) -> Box:
        """In the cavity frame."""
        return self.frame.box(self.block)


def raised(
    sockets: tuple[Socket, ...], rim_mm: float, start_mm: float, fixing_holes: tuple[Hole, ...], mold: Mold
) -> tuple[tuple[Collar, ...], tuple[Socket, ...]]:
    """The collars that a mold needs, and its sockets opened up through them.

    Parameters
    ----------
    rim_mm : level of the rim
    start_mm : how far the rim is opened outward of the cavity; a collar starts there
    """
    if not mold.raised_sockets:
        return (), sockets
    collars = [
        collar
        for row in by_wall(sockets).values()
        for collar in _of_wall(row, rim_mm, start_mm, mold.min_web_mm)
        if all(collar.frame.gap_mm(collar.block, hole) >= mold.min_web_mm for hole in fixing_holes)
    ]
    tops = {name: collar.top_mm for collar in collars for name in collar.names}
    opened = tuple(
        socket.open_to(tops[socket.part.name]) if socket.part.name in tops else socket for socket in sockets
    )
    return tuple(collars), opened


def _of_wall(row: Sequence[Socket], rim_mm: float, start_mm: float, web_mm: float) -> Iterator[Collar]:
    """A socket that needs no collar ends the one before it."""
    held: list[Socket] = []
    for socket in row:
        is_tall = socket.part.body_top_mm > rim_mm + ROUNDING_MM
        apart = bool(held) and socket.pocket.along0 - held[-1].pocket.along1 >= OWN_COLLAR_WEBS * web_mm
        if held and (apart or not is_tall):
            yield _collar(held, rim_mm, start_mm, web_mm)
            held = []
        if is_tall:
            held.append(socket)
    if held:
        yield _collar(held, rim_mm, start_mm, web_mm)


def _collar(held: Sequence[Socket], rim_mm: float, start_mm: float, web_mm: float) -> Collar:
    frame = held[0].frame
    deepest = max(socket.pocket.out1 for socket in held)
    return Collar(
        names=tuple(socket.part.name for socket in held),
        frame=frame,
        block=Cut(
            along0=held[0].pocket.along0 - web_mm,
            along1=held[-1].pocket.along1 + web_mm,
            out0=start_mm,
            out1=min(deepest + web_mm, frame.thickness_mm),
            floor=rim_mm,
            top=max(socket.part.body_top_mm for socket in held),
        ),
    )


def by_wall(sockets: tuple[Socket, ...]) -> dict[str, tuple[Socket, ...]]:
    """Sockets of each wall, in the order in which they stand along it; walls south, east, north, west, or facets."""
    names = dict.fromkeys((*WALLS, *(socket.frame.wall for socket in sockets)))
    return {
        wall: tuple(
            sorted((s for s in sockets if s.frame.wall == wall), key=lambda socket: socket.pocket.along0)
        )
        for wall in names
    }
