"""What is said of an exported recording."""

from __future__ import annotations

import math
from typing import Any

from optopad.fabrication.driver.recording.joined_log import JoinedLog
from optopad.fabrication.driver.recording.recorded import Recorded


def recording_told(found: Recorded, join: JoinedLog | None) -> tuple[dict[str, Any], list[str]]:
    """What is said of a recording, as JSON and as lines."""
    document: dict[str, Any] = {
        "frames": len(found.sequence),
        "lost": found.lost,
        "doubled": found.doubled,
        "connections": int(found.connection[-1]),
        "ended_cleanly": found.ended_cleanly,
        "stray_bytes": found.stray_bytes,
        "left_out": found.left_out,
        "missing_files": list(found.missing_files),
        "has_presses": found.press_mm is not None,
    }
    lines = [f"{len(found.sequence)} frames, {found.losses}"]
    if join is not None:
        document["stage"] = _join_json(join)
        lines.append(_join_line(join))
    if found.press_mm is None:
        lines.append(
            "presses   none; `optopad compare` needs them (--presses, --stage, or the recorder's press())"
        )
    return document, lines


def _join_json(join: JoinedLog) -> dict[str, Any]:
    match = join.match
    has_edges = math.isfinite(match.spread_s)
    return {
        "offset_s": round(join.offset_s, 4),
        "edges": match.edges,
        "edges_met": round(match.share, 4),
        "lag_s": round(match.offset_s - join.offset_s, 4) if has_edges else None,
        "spread_s": round(match.spread_s, 4) if has_edges else None,
        "left_out": join.left_out,
    }


def _join_line(join: JoinedLog) -> str:
    match, text = join.match, f"log       offset {join.offset_s:.3f} s"
    if math.isfinite(match.spread_s):
        lag = match.offset_s - join.offset_s
        text += f"; {match.share:.0%} of {match.edges} touch edges match"
        text += f", {lag:+.3f} s late, scatter {match.spread_s:.3f} s"
    return text + f"; {join.left_out} frames without a known position left out"
