"""A moving finger for the simulated board, or two, which follow a path of presses over time and repeat it forever.

A path is linear between its points. Its file is CSV with the heading `t_s,x_mm,y_mm,depth_mm`; times increase from 0.
A second finger has the columns `x2_mm,y2_mm,depth2_mm`. A finger at a depth of 0 or less does not touch.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from optopad.design.arrays import FloatArray
from optopad.design.csv_table import read_csv
from optopad.design.errors import InputError
from optopad.fabrication.driver_file import WorkspaceLimits

HEADING = ("t_s", "x_mm", "y_mm", "depth_mm")
SECOND = ("x2_mm", "y2_mm", "depth2_mm")
HOVER_MM = -1.0
"""Depth of a lifted finger [mm]; at a depth of 0 or less, the pad is untouched."""


DRAG_MM, SLIDE_MM_S = 0.4, 10.0
"""Distance by which the demonstration's finger drags the pad's surface along before it slides [mm], and speed of the
slide [mm/s]."""

APART_SHARE = 0.4
"""Nearest distance of the demonstration's two fingers while they pass each other, over the workspace's width [-]."""


class Finger(Protocol):
    """Interface of an object that presses the simulated pad."""

    def at(self, time_s: ArrayLike) -> FloatArray:
        """Positions (x, y, depth) at n times since the board's reset [s]; shape (n, 3), or (n, tip, 3) [mm]."""


@dataclass(frozen=True, kw_only=True)
class FingerPath:
    """Path of one finger or of several over time, linear between its points and repeated forever.

    Attributes
    ----------
    time_s : times of the n points, increasing from 0; the path repeats after the last one [s]
    press_mm : positions (x, y, depth) of the points in the cavity's coordinate system, shape (n, 3), or (n, tip, 3) of
        several fingers [mm]
    """

    time_s: FloatArray
    press_mm: FloatArray

    @property
    def fingers(self) -> int:
        """Number of fingers."""
        return int(self.press_mm[0].size) // 3

    def at(self, time_s: ArrayLike) -> FloatArray:
        """Positions at n times since the board's reset [s]; shape (n, 3), or (n, tip, 3) of several fingers [mm]."""
        period = self.time_s[-1]
        within = np.asarray(time_s, dtype=np.float64) % period if period > 0 else np.zeros(np.shape(time_s))
        columns = self.press_mm.reshape(len(self.press_mm), -1).T
        found = np.stack([np.interp(within, self.time_s, column) for column in columns], axis=-1)
        return found.reshape(*within.shape, *self.press_mm.shape[1:])

    def nearest_mm(self) -> FloatArray:
        """(n - 1,) least distance of the two tips' centres from each point to the next [mm]; (1,) of a single point.

        It is infinite where they do not touch both at a time. Depth is taken along z, as on a flat top.
        """
        points = self.press_mm if len(self.press_mm) > 1 else self.press_mm.repeat(2, axis=0)
        tips = points.reshape(len(points), -1, 3)
        if self.fingers != 2:
            return np.full(len(tips) - 1, np.inf)
        depth, slope = tips[:-1, :, 2], np.diff(tips[..., 2], axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossed = -depth / slope  # share of the way at which a finger begins or ends to touch
        starts = np.where(depth > 0.0, 0.0, np.where(slope > 0.0, crossed, np.inf)).max(axis=1)
        ends = np.where(depth + slope > 0.0, 1.0, np.where(slope < 0.0, crossed, -np.inf)).min(axis=1)
        apart = tips[:, 1] - tips[:, 0]
        way = np.diff(apart, axis=0)
        best = -(apart[:-1] * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), TINY)
        is_both = starts < ends
        share = np.where(is_both, np.clip(best, starts, np.maximum(starts, ends)), 0.0)
        return np.where(is_both, np.linalg.norm(apart[:-1] + share[:, None] * way, axis=1), np.inf)

    def csv_text(self) -> str:
        """The path as a CSV file."""
        rows = np.column_stack([self.time_s, self.press_mm.reshape(len(self.time_s), -1)])
        lines = [",".join(f"{value:g}" for value in row) for row in rows]
        return "\n".join([",".join((*HEADING, *SECOND)[: rows.shape[1]]), *lines]) + "\n"


TINY = 1e-12
NO_FINGER = FingerPath(time_s=np.zeros(1), press_mm=np.array([[0.0, 0.0, HOVER_MM]]))


def demo_path(workspace: WorkspaceLimits, rest_s: float = 2.0) -> FingerPath:
    """A path for demonstrations: rest, deepest presses in the middle and near the corners, a stroke across the pad.

    Before the stroke the finger is held and drags the pad's surface along slowly, as an object that sticks; then it
    slides at a set speed, so the path takes longer on a wide pad: 14 s plus `rest_s` at 20 mm.

    Parameters
    ----------
    rest_s : time at the start during which the pad is untouched, for a baseline [s]
    """
    x0, x1, y0, y1 = workspace.x0_mm, workspace.x1_mm, workspace.y0_mm, workspace.y1_mm
    deep = workspace.max_depth_mm
    places = [(0.5, 0.5), (0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8)]
    steps = [(0.0, 0.5, 0.5, HOVER_MM), (rest_s, 0.5, 0.5, HOVER_MM)]
    for k, (u, v) in enumerate(places):
        begun = rest_s + 2.0 * k
        steps += [(begun + 0.4, u, v, HOVER_MM), (begun + 1.2, u, v, deep), (begun + 1.9, u, v, HOVER_MM)]
    stroke, dragged = rest_s + 2.0 * len(places), 0.1 + DRAG_MM / (x1 - x0)
    slid = stroke + 1.9 + (0.9 - dragged) * (x1 - x0) / SLIDE_MM_S
    steps += [
        (stroke + 0.4, 0.1, 0.5, HOVER_MM),
        (stroke + 0.9, 0.1, 0.5, deep / 3),
        (stroke + 1.4, 0.1, 0.5, deep / 3),
        (stroke + 1.9, dragged, 0.5, deep / 3),
        (slid, 0.9, 0.5, deep / 3),
        (slid + 0.5, 0.9, 0.5, HOVER_MM),
        (slid + 0.6, 0.5, 0.5, HOVER_MM),
    ]
    rows = np.array(steps)
    x_mm, y_mm = x0 + rows[:, 1] * (x1 - x0), y0 + rows[:, 2] * (y1 - y0)
    return FingerPath(time_s=rows[:, 0], press_mm=np.column_stack([x_mm, y_mm, rows[:, 3]]))


def two_finger_path(
    workspace: WorkspaceLimits, tip_radius_mm: float = 0.0, rest_s: float = 2.0
) -> FingerPath:
    """A path of two fingers: rest, a press apart from each other, two strokes past each other, one lifted.

    The strokes are parallel, against each other, at the speed of the slide of `demo_path`. The second finger is less
    deep, so that the fingers can also be told apart by depth. Both remain `APART_SHARE` of the workspace's width apart,
    and at least 2.2 tip radii.

    Parameters
    ----------
    tip_radius_mm : radius of the tips; 0 if it is not known [mm]
    rest_s : time at the start during which the pad is untouched, for a baseline [s]

    Raises
    ------
    InputError : two such tips do not fit beside each other.
    """
    x0, x1, y0, y1 = workspace.x0_mm, workspace.x1_mm, workspace.y0_mm, workspace.y1_mm
    apart_mm = max(APART_SHARE * (y1 - y0), 2.2 * tip_radius_mm)
    if apart_mm > y1 - y0:
        raise InputError(
            f"--fingers: two tips with a radius of {tip_radius_mm:g} mm need {apart_mm:g} mm, the workspace is "
            f"{y1 - y0:g} mm wide along y; leave --fingers out, or set a smaller indenter.tip_radius_mm"
        )
    deep, less = workspace.max_depth_mm / 3, workspace.max_depth_mm / 4
    low, high = (y0 + y1 - apart_mm) / 2, (y0 + y1 + apart_mm) / 2
    left, right = x0 + 0.2 * (x1 - x0), x0 + 0.8 * (x1 - x0)
    slide_s = (right - left) / SLIDE_MM_S
    steps = [  # time from the step before, then depth of both; whether they have slid
        (0.0, HOVER_MM, HOVER_MM, False),
        (rest_s, HOVER_MM, HOVER_MM, False),
        (0.5, deep, less, False),
        (0.5, deep, less, False),
        (slide_s, deep, less, True),
        (0.3, deep, less, True),
        (0.5, deep, HOVER_MM, True),
        (0.7, deep, HOVER_MM, True),
        (0.5, HOVER_MM, HOVER_MM, True),
        (0.2, HOVER_MM, HOVER_MM, False),
    ]
    return FingerPath(
        time_s=np.cumsum([step_s for step_s, *_ in steps]),
        press_mm=np.array(
            [
                [(right if slid else left, low, one), (left if slid else right, high, other)]
                for _, one, other, slid in steps
            ]
        ),
    )


def read_path(file: Path, tip_radius_mm: float = 0.0) -> FingerPath:
    """Read the path of a finger, or of two, from a CSV file.

    Parameters
    ----------
    tip_radius_mm : radius of the tips, nearer than two of which they overlap; 0 if it is not known [mm]

    Raises
    ------
    InputError : the file cannot be read, a column is missing, a value is not a number, the times do not increase from
        0, or the tips of two fingers overlap.
    """
    table = read_csv(file, needed=f"a CSV table with {','.join(HEADING)}, one point per row", lower=True)
    names = (*HEADING, *SECOND) if any(name in table.heading for name in SECOND) else HEADING
    if missing := [name for name in names if name not in table.heading]:
        raise InputError(f"{file}: has no {', '.join(missing)}; needs the heading {','.join(names)}")
    values = np.array([table.numbers(name) for name in names]).T
    if values[0, 0] != 0.0 or (np.diff(values[:, 0]) <= 0).any():
        raise InputError(f"{file}: t_s must rise from 0 s, is {values[:, 0].tolist()[:5]} ...")
    press_mm = values[:, 1:] if names == HEADING else values[:, 1:].reshape(-1, 2, 3)
    path = FingerPath(time_s=values[:, 0], press_mm=press_mm)
    nearest_mm = path.nearest_mm()
    if (near := np.flatnonzero(nearest_mm < 2.0 * tip_radius_mm)).size:
        row = int(near[0])
        raise InputError(
            f"{table.where(row)}: until the next row the fingers come within {nearest_mm[row]:.2f} mm of each other, "
            f"and tips with a radius of {tip_radius_mm:g} mm need {2.0 * tip_radius_mm:g} mm; move x2_mm, y2_mm away, "
            "or lift one (depth2_mm of 0 or less)"
        )
    return path
