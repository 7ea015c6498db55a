# mypy: no-warn-return-any
"""The search for a track's path on a raster of two layers, compiled."""

from __future__ import annotations

import sys

import numpy as np
from numba import njit

from optopad.design.arrays import BoolArray, IntArray
from optopad.sims.kernels import entry_points

STRAIGHT, DIAGONAL = 10, 14
"""Cost of a step to the next place of the raster."""
AGAINST = 3
"""Additional cost of a step across a layer's usual direction: x on the top, y on the bottom."""
VIA_COST = 90
BUCKETS = 1 << 14
"""Number of costs that are kept in order; every step costs less."""
NEVER = 1 << 60
"""Cost of a place that no path has reached."""


@njit(inline="always")
def _ahead(row: int, column: int, goal_box: IntArray) -> int:
    """Least cost from a place to the box of the goals."""
    dy = max(goal_box[0] - row, row - goal_box[1], 0)
    dx = max(goal_box[2] - column, column - goal_box[3], 0)
    return STRAIGHT * max(dx, dy) + (DIAGONAL - STRAIGHT) * min(dx, dy)


@entry_points((sys.modules[__name__],), error_model="numpy", nogil=True)
def cheapest_path(
    owners: IntArray, counts: IntArray, sums: IntArray, learnt: IntArray, drills: IntArray, net: int, crossing: int,
    starts: IntArray, is_goal: BoolArray, goal_box: IntArray, best: IntArray, before: IntArray, heads: IntArray,
) -> tuple[IntArray, int]:  # fmt: skip
    """The cheapest path (A*) from one of the starts to one of the goals, and the number of places that were considered.

    The path is the indices of its places; it is empty if there is none.

    Parameters
    ----------
    owners : (3, rows, columns) net that alone may use a place: of tracks on the top and bottom, and of vias; 0 for all,
        negative for none
    counts, sums : number of nets whose tracks keep others off a place, and the sum of these nets, as `owners`
    learnt : (2, rows, columns) additional cost of a place
    drills : (rows, columns) number of vias that are too near for another one
    net : number of the net
    crossing : cost of a place that another net's track occupies; negative if it is forbidden
    starts : indices (n,) of places of the raster
    is_goal : (2 * rows * columns,) whether a place is a goal
    goal_box : first and last row, first and last column of the goals
    best, before : (2 * rows * columns,) working memory; `best` is `NEVER` everywhere, before and after
    heads : (BUCKETS,) working memory; -1 everywhere, before and after
    """
    _, rows, columns = owners.shape
    layer_size = rows * columns
    owner, count, total_of = owners.ravel(), counts.ravel(), sums.ravel()
    extra, near_drills = learnt.ravel(), drills.ravel()
    places, costs, following = [np.int64(0)], [np.int64(0)], [np.int64(-1)]
    waiting, level, goal = 0, np.int64(1) << 40, np.int64(-1)
    for start in starts:
        here = start % layer_size
        ahead = _ahead(here // columns, here % columns, goal_box)
        best[start] = 0
        before[start] = -1
        slot = ahead % BUCKETS
        places.append(start)
        costs.append(np.int64(0))
        following.append(heads[slot])
        heads[slot] = len(places) - 1
        waiting += 1
        level = min(level, np.int64(ahead))
    while waiting > 0:
        bucket = level % BUCKETS
        entry = heads[bucket]
        if entry < 0:
            level += 1
            continue
        heads[bucket] = following[entry]
        waiting -= 1
        place, cost = places[entry], costs[entry]
        if cost > best[place]:
            continue
        if is_goal[place]:
            goal = place
            break
        layer = place // layer_size
        here = place - layer * layer_size
        row = here // columns
        column = here - row * columns
        for move in range(9):
            to_row, to_column, there = row, column, place
            if move == 8:
                at = 2 * layer_size + here
                if near_drills[here] > 0 or (owner[at] != 0 and owner[at] != net):
                    continue
                step = VIA_COST
                if count[at] > 1 or (count[at] == 1 and total_of[at] != net):
                    if crossing < 0:
                        continue
                    step += crossing
                there = here + (1 - layer) * layer_size
            else:
                dx, dy = (1, 1, 0, -1, -1, -1, 0, 1)[move], (0, 1, 1, 1, 0, -1, -1, -1)[move]
                to_row, to_column = row + dy, column + dx
                if to_row < 0 or to_column < 0 or to_row >= rows or to_column >= columns:
                    continue
                there = layer * layer_size + to_row * columns + to_column
                step = DIAGONAL if dx != 0 and dy != 0 else STRAIGHT
                if (layer == 0 and dx == 0) or (layer == 1 and dy == 0):
                    step += AGAINST
            if owner[there] != 0 and owner[there] != net:
                continue
            if count[there] > 1 or (count[there] == 1 and total_of[there] != net):
                if crossing < 0:
                    continue
                step += crossing
            total = cost + step + extra[there]
            if total < best[there]:
                best[there] = total
                before[there] = place
                slot = (total + _ahead(to_row, to_column, goal_box)) % BUCKETS
                places.append(there)
                costs.append(total)
                following.append(heads[slot])
                heads[slot] = len(places) - 1
                waiting += 1
    length, place = 0, goal
    while place >= 0:
        place = before[place]
        length += 1
    path = np.empty(length, dtype=np.int64)
    place = goal
    for k in range(length - 1, -1, -1):
        path[k] = place
        place = before[place]
    for place in places:
        best[place] = NEVER
    heads[:] = -1
    return path, len(places)
