"""Comparison of a recorded press with the simulated one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.screen.shown import Result
from optopad.sims.learning.recorded_press import RecordedPair, RecordedPress


@dataclass(frozen=True, kw_only=True, repr=False)
class ComparedRecording(Result):
    """A comparison of simulated and recorded presses, and the paths of its files."""

    press: RecordedPress
    digest: str
    recording: str
    folder: Path
    stem: str

    def to_json(self) -> dict[str, Any]:
        """The comparison as plain data for JSON."""
        return {
            "digest": self.digest,
            "recording": self.recording,
            "place_mm": [round(value, 4) for value in self.press.place_mm],
            "pairs": [_pair_json(pair) for pair in self.press.pairs],
            "notes": list(self.press.notes),
            "files": str(self.folder),
        }

    def lines(self) -> list[str]:
        """A few lines: how far each pair's measured and simulated signals are apart."""
        x_mm, y_mm = self.press.place_mm
        lines = [f"press     at x {x_mm:g}, y {y_mm:g} mm"]
        for pair in self.press.pairs:
            modes = pair.simulated.score.modes
            lines.append(
                f"{pair.simulated.name:<9} measured and simulated differ by {pair.rms:.1%} of the untouched "
                f"signal (rms; {pair.worst:.1%} at most); untouched {pair.untouched_counts:.0f}; mode 1 to "
                f"{modes.mode1_mm[1]:.2f} mm, mode 2 "
                + ("never" if modes.mode2_mm[0] is None else f"from {modes.mode2_mm[0]:.2f} mm")
            )
        return lines + [f"note      {text}" for text in self.press.notes]

    def screen(self) -> list[str]:
        """The comparison, and its files."""
        return [*self.lines(), f"files     {self.folder} ({self.stem}: json, svg, png)"]


def _pair_json(pair: RecordedPair) -> dict[str, Any]:
    return {
        "pair": pair.simulated.name,
        "rms": round(pair.rms, 5),
        "worst": round(pair.worst, 5),
        "untouched_counts": round(pair.untouched_counts, 3),
        "depth_mm": pair.depth_mm.round(4).tolist(),
        "measured": pair.ratio.round(5).tolist(),
        "press_readings": pair.deepest + 1,
        "simulated_depth_mm": pair.simulated.curves.depth_mm.tolist(),
        "simulated": (pair.simulated.curves.total / pair.simulated.curves.total[0]).round(6).tolist(),
    }
