# mypy: no-warn-return-any
"""Kernels: cells of the top whose light is reflected again and may reach a receiver, found by dividing larger ones.

The paths from the emitter's centre over the corners of a cell tell where its light ends. A cell is dropped where that
is nowhere near a wanted receiver, divided where its corners' ends lie far apart or have different fates, and else kept,
with the more points the more power it has for the dimmest receiver near.
"""

from __future__ import annotations

import math

from design.arrays import FloatArray
from sims.optics.engine.scattered.landing import landing, put_point, unit_there
from sims.optics.engine.scattered.top_light import ALONG, ECHO_COLUMNS, KIND, POWER, TOPS, UP
from sims.optics.surface.radial import kernel
from sims.optics.surface.top import Top

# columns of a cell: borders, halvings, then its corners' echoes, whose power is that of a unit of (u, v):
# (low u, low v), (low u, high v), (high u, low v), (high u, high v)
LOW_U, HIGH_U, LOW_V, HIGH_V, LEVEL, CORNERS = range(6)
CELL_COLUMNS = CORNERS + 4 * ECHO_COLUMNS
DROP, DIVIDE, KEEP = range(3)
UNKNOWN = -1.0
"""Power of a corner that nobody has looked at."""

STEP_MM = 1.0
"""Distance between the ends of a cell's corners below which it is divided no further."""
CURVE = 0.15
"""Share of that distance by which light from within a cell may end beyond that of its corners."""
MIXED_MM = 2.0
"""How much farther where corners have different fates."""
DEEPEST, DEEPEST_MIXED, DEEPEST_UNSEEN = 6, 4, 2
"""Most halvings of a cell, of one whose corners have different fates, and of one that only edges of emitters light."""
KEPT_UNITS = 4.0
"""Units of power that a kept cell may hold: points in it cost less than the paths over the corners of its quarters."""
MOST_PARTS = 4.0
"""Most parts of a kept cell along each side, one point in each."""
STACK = 3 * DEEPEST + 4
BLUR_MM = 4.0
"""Farthest from the end of the emitter's centre that the light of its edges is looked for. What two rays beside the
centre's tell of that is too little where mirrors bend: it cost up to 0.3 % of a pair's signal."""


@kernel
def power_near(
    a: int, b: int, first: int, columns: FloatArray, echoes: FloatArray, receivers: FloatArray, units: FloatArray,
) -> tuple[float, float]:  # fmt: skip
    """Largest power of the rays by a cell or a neighbour, of all replicates, that are reflected again, on walls where
    they end around a wanted receiver, and the unit there; 0 where nowhere; negative if none is reflected again.

    first : the first row that is not in the contact; units : see `sims.optics.engine.scattered.repeated`
    """
    most = 0.0
    unit = 0.0
    is_lit = False
    for wall in range(4):
        power = 0.0
        low_s = low_z = 1e9
        high_s = high_z = -1e9
        for near in range(3):
            c = b if near == 0 else int(columns[b, 2 + near])
            for d in range(max(a - 1, first), min(a + 2, echoes.shape[1])):
                for n in range(echoes.shape[0]):
                    echo = echoes[n, d, c]
                    if echo[POWER] > 0.0 and echo[TOPS] > 0.0:
                        is_lit = True
                        if echo[KIND] == wall:
                            power = max(power, echo[POWER])
                            low_s = min(low_s, echo[ALONG])
                            high_s = max(high_s, echo[ALONG])
                            low_z = min(low_z, echo[UP])
                            high_z = max(high_z, echo[UP])
        if power > most:
            there = unit_there(
                wall,
                low_s - MIXED_MM,
                high_s + MIXED_MM,
                low_z - MIXED_MM,
                high_z + MIXED_MM,
                receivers,
                units,
            )
            if there > 0.0:
                most = power
                unit = there
    return (most if is_lit else -1.0), unit


@kernel
def corner(cell: FloatArray, c: int, column: int) -> float:
    """A number of the echo of a cell's corner."""
    return cell[CORNERS + c * ECHO_COLUMNS + column]


@kernel
def put_echo(cell: FloatArray, c: int, echo: FloatArray) -> None:
    """Copy an echo to a cell's corner."""
    for k in range(ECHO_COLUMNS):
        cell[CORNERS + c * ECHO_COLUMNS + k] = echo[k]


@kernel
def put_corner(
    echo: FloatArray, sector: int, u: float, v: float, source: FloatArray, sectors: FloatArray, box: FloatArray,
    top: Top, p: FloatArray,
) -> None:  # fmt: skip
    """Fill the echo of the path from the emitter's centre over a point of the top; power 0 if it is not mirrored again
    on its way to a wall.
    """
    put_point(p, sector, u, v, sectors, top)
    power, kind, s, z, tops, _, _ = landing(p, source[1], source[2], source, box, top)
    is_on = power > 0.0 and tops > 0 and 0 <= kind < 4
    echo[POWER] = power if is_on else 0.0
    echo[KIND] = kind
    echo[ALONG] = s
    echo[UP] = z
    echo[TOPS] = tops


@kernel
def _bounds(cell: FloatArray, wall: int) -> tuple[int, bool, float, float, float, float]:
    """Number of lit corners that end on a wall, whether after equally many reflections, and the box of their ends."""
    count = 0
    is_alike = True
    tops = 0.0
    low_s = low_z = 1e9
    high_s = high_z = -1e9
    for c in range(4):
        if corner(cell, c, POWER) > 0.0 and corner(cell, c, KIND) == wall:
            low_s = min(low_s, corner(cell, c, ALONG))
            high_s = max(high_s, corner(cell, c, ALONG))
            low_z = min(low_z, corner(cell, c, UP))
            high_z = max(high_z, corner(cell, c, UP))
            is_alike = is_alike and (count == 0 or tops == corner(cell, c, TOPS))
            tops = corner(cell, c, TOPS)
            count += 1
    return count, is_alike, low_s, high_s, low_z, high_z


@kernel
def fate_of(
    cell: FloatArray, unseen: float, unseen_unit: float, receivers: FloatArray, units: FloatArray
) -> tuple[int, int]:
    """What to do with a cell; if it is kept, into how many parts along each side.

    unseen : power that the emitter's edges may send over the undivided cell where its centre sends none
    unseen_unit : power that a sample of it may stand for; units : (receiver,) the same by where the centre sends it
    """
    brightest = max(
        max(corner(cell, 0, POWER), corner(cell, 1, POWER)),
        max(corner(cell, 2, POWER), corner(cell, 3, POWER)),
    )
    if brightest == 0.0:
        if cell[LEVEL] == 0.0:
            return DIVIDE, 1
        if unseen == 0.0:
            return DROP, 1
        power = unseen * 0.25 ** cell[LEVEL]
        is_kept = cell[LEVEL] >= DEEPEST_UNSEEN or power < unseen_unit
        return (KEEP if is_kept else DIVIDE), _parts(power, unseen_unit)
    unit = 0.0
    is_whole = False
    size = 0.0
    for wall in range(4):
        count, is_alike, low_s, high_s, low_z, high_z = _bounds(cell, wall)
        if count == 0:
            continue
        size = max(high_s - low_s, high_z - low_z)
        is_whole = count == 4 and is_alike
        margin = BLUR_MM + (CURVE * size if is_whole else MIXED_MM + size)
        there = unit_there(
            wall, low_s - margin, high_s + margin, low_z - margin, high_z + margin, receivers, units
        )
        if there > 0.0 and (unit == 0.0 or there < unit):
            unit = there
    if unit == 0.0:
        return DROP, 1
    power = brightest * (cell[HIGH_U] - cell[LOW_U]) * (cell[HIGH_V] - cell[LOW_V])
    is_kept = (
        power < KEPT_UNITS * unit
        or (is_whole and size <= STEP_MM)
        or cell[LEVEL] >= (DEEPEST if is_whole else DEEPEST_MIXED)
    )
    return (KEEP if is_kept else DIVIDE), _parts(power, unit)


@kernel
def _parts(power: float, unit: float) -> int:
    """Parts along each side of a cell for points that stand for a unit of power each."""
    return int(min(max(math.ceil(math.sqrt(power / unit)), 1.0), MOST_PARTS))


@kernel
def put_first(
    cell: FloatArray, root: tuple[int, float, float, float, float], next_column: int, a: int, b: int,
    known: FloatArray, source: FloatArray, sectors: FloatArray, box: FloatArray, top: Top, p: FloatArray,
) -> None:  # fmt: skip
    """Fill a cell from ring a and column b of the lattice; `known` (ring, column, echo) remembers corners."""
    sector, low_u, high_u, low_v, high_v = root
    cell[LOW_U] = low_u
    cell[HIGH_U] = high_u
    cell[LOW_V] = low_v
    cell[HIGH_V] = high_v
    cell[LEVEL] = 0.0
    for c in range(4):
        echo = known[a + c // 2, b if c % 2 == 0 else next_column]
        if echo[POWER] == UNKNOWN:
            put_corner(
                echo,
                sector,
                low_u if c < 2 else high_u,
                low_v if c % 2 == 0 else high_v,
                source,
                sectors,
                box,
                top,
                p,
            )
        put_echo(cell, c, echo)


@kernel
def divide(
    cells: FloatArray, n: int, sector: int, source: FloatArray, sectors: FloatArray, box: FloatArray, top: Top,
    p: FloatArray, nine: FloatArray,
) -> None:  # fmt: skip
    """Put the quarters of cells[n] in its place and behind it."""
    cell = cells[n]
    us = (cell[LOW_U], 0.5 * (cell[LOW_U] + cell[HIGH_U]), cell[HIGH_U])
    vs = (cell[LOW_V], 0.5 * (cell[LOW_V] + cell[HIGH_V]), cell[HIGH_V])
    level = cell[LEVEL] + 1.0
    for a in range(3):
        for b in range(3):
            if a != 1 and b != 1:
                for k in range(ECHO_COLUMNS):
                    nine[a, b, k] = corner(cell, a + b // 2, k)
            else:
                put_corner(nine[a, b], sector, us[a], vs[b], source, sectors, box, top, p)
    for a in range(2):
        for b in range(2):
            part = cells[n + 2 * a + b]
            part[LOW_U] = us[a]
            part[HIGH_U] = us[a + 1]
            part[LOW_V] = vs[b]
            part[HIGH_V] = vs[b + 1]
            part[LEVEL] = level
            for c in range(4):
                put_echo(part, c, nine[a + c // 2, b + c % 2])
