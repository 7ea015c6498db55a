"""A moving finger for the simulated board, which follows a path of presses over time and repeats it forever.

A path is linear between its points. Its file is CSV with the heading `t_s,x_mm,y_mm,depth_mm`; times increase from 0.
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
HOVER_MM = -1.0
"""Depth of a lifted finger [mm]; at a depth of 0 or less, the pad is untouched."""


DRAG_MM, SLIDE_MM_S = 0.4, 10.0
"""Distance by which the demonstration's finger drags the pad's surface along before it slides [mm], and speed of the
slide [mm/s]."""


class Finger(Protocol):
    """Interface of an object that presses the simulated pad."""

    def at(self, time_s: ArrayLike) -> FloatArray:
        """Positions (x, y, depth) at n times since the board's reset [s]; shape (n, 3) [mm]."""


@dataclass(frozen=True, kw_only=True)
class FingerPath:
    """Path of a finger over time, linear between its points and repeated forever.

    Attributes
    ----------
    time_s : times of the n points, increasing from 0; the path repeats after the last one [s]
    press_mm : positions (x, y, depth) of the points in the cavity's coordinate system, shape (n, 3) [mm]
    """

    time_s: FloatArray
    press_mm: FloatArray

    def at(self, time_s: ArrayLike) -> FloatArray:
        """Positions (x, y, depth) at n times since the board's reset [s]; shape (n, 3) [mm]."""
        period = self.time_s[-1]
        within = np.asarray(time_s, dtype=np.float64) % period if period > 0 else np.zeros(np.shape(time_s))
        return np.stack([np.interp(within, self.time_s, column) for column in self.press_mm.T], axis=-1)

    def csv_text(self) -> str:
        """The path as a CSV file."""
        rows = np.column_stack([self.time_s, self.press_mm])
        lines = [",".join(f"{value:g}" for value in row) for row in rows]
        return "\n".join([",".join(HEADING), *lines]) + "\n"


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


def read_path(file: Path) -> FingerPath:
    """Read the path of a finger from a CSV file.

    Raises
    ------
    InputError : the file cannot be read, a column is missing, a value is not a number, or the times do not increase
        from 0.
    """
    table = read_csv(file, needed=f"a CSV table with {','.join(HEADING)}, one point per row", lower=True)
    if missing := [name for name in HEADING if name not in table.heading]:
        raise InputError(f"{file}: has no {', '.join(missing)}; needs the heading {','.join(HEADING)}")
    values = np.array([table.numbers(name) for name in HEADING]).T
    if values[0, 0] != 0.0 or (np.diff(values[:, 0]) <= 0).any():
        raise InputError(f"{file}: t_s must rise from 0 s, is {values[:, 0].tolist()[:5]} ...")
    return FingerPath(time_s=values[:, 0], press_mm=values[:, 1:])
