"""Reads the log of a load cell: the force on the tip over time.

The file is CSV with a heading; lines that start with # are comments. It has a time, as in a stage's log
(`fabrication.driver.recording.position_log`), and one force, positive when the tip presses the pad:

    force_n              newtons (also force_mn, millinewtons)
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from design.arrays import FloatArray
from design.csv_table import read_csv
from design.errors import InputError
from fabrication.driver.recording.clock_match import Touches
from fabrication.driver.recording.position_log import require_rising, times_of

FORCES_N = {"force_n": 1.0, "force_mn": 1e-3}
MASSES = {"kg": 9.80665, "g": 9.80665e-3}
"""Newtons of a unit of mass under standard gravity, for the way out of a log in these units."""
NEEDED = (
    "a CSV table with time_s (or time_ms, time_us, time_ns, or time as ISO 8601) and force_n (or force_mn)"
)
TOUCHED_SHARE = 0.05
"""A touch begins and ends where the force crosses this share of its largest value [-]."""


@dataclass(frozen=True, kw_only=True)
class ForceLog:
    """Force on the tip at n increasing times of the log's clock: `time_s` (n,) [s], `force_n` (n,) [N]."""

    file: str
    time_s: FloatArray
    force_n: FloatArray

    @property
    def touches(self) -> Touches:
        """Touches, where the force is above a twentieth of its largest value, counted from its median at rest."""
        above = self.force_n - np.quantile(self.force_n, 0.1)
        touched = above > TOUCHED_SHARE * above.max()
        change = np.flatnonzero(touched[1:] != touched[:-1])
        between = (self.time_s[change] + self.time_s[change + 1]) / 2
        return Touches(
            begin_s=between[touched[change + 1]],
            end_s=between[~touched[change + 1]],
            span_s=(float(self.time_s[0]), float(self.time_s[-1])),
        )


def read_force_log(file: Path) -> ForceLog:
    """Read a load cell's log.

    Raises
    ------
    InputError : the file cannot be read, a column or number is missing, the force has another unit, or the times do not
        increase.
    """
    table = read_csv(file, needed=NEEDED, fewest_rows=2, lower=True)
    time_s = times_of(table, NEEDED)
    require_rising(table, time_s)
    for name, unit_n in FORCES_N.items():
        if name in table.heading:
            return ForceLog(file=str(file), time_s=time_s, force_n=unit_n * np.array(table.numbers(name)))
    for unit, newtons in MASSES.items():
        named = [name for name in table.heading if name == unit or name.endswith(f"_{unit}")]
        if named:
            raise InputError(
                f"{file}: {named[0]} is a mass, needs a force; multiply by {newtons:g} and name the column force_n"
            )
    raise InputError(
        f"{file}: has no force_n (or force_mn); it has {', '.join(table.heading)}; needs {NEEDED}"
    )
