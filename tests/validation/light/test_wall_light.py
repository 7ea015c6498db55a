"""What near walls change of light: a reduced copy of docs/validation/walls.md, by the same code."""

from __future__ import annotations

import numpy as np
import pytest

from sims.cache.light_store import SIZE_VARIABLE
from sims.optics.accuracy import ACCURACIES
from tests.validation.light.wall_light import MARKS, PAGE, PLACES_MM, change_at, table


def test_walls_change_signals_more_the_deeper_the_press() -> None:
    """6 mm from a wall, by 0.6 and 2.7 % rms: the page's figures within the error that the draft setting claims."""
    depths = (1.0, 3.0)
    found = change_at((6.0, 16.0), depths, ACCURACIES["draft"])
    assert (np.abs(found.rms - [0.006, 0.027]) < found.claimed).all()
    assert found.claimed.max() < 0.01
    assert found.rms[1] > 5 * found.claimed[1]
    assert (found.largest >= found.rms).all()
    lines = table([found], depths).splitlines()
    assert len(lines) == 3
    assert lines[2].startswith("| (6, 16) | ")


def test_kept_light_is_refused_where_time_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SIZE_VARIABLE, "10")
    with pytest.raises(ValueError, match="OPTOPAD_LIGHT_CACHE_MB=0"):
        change_at((6.0, 16.0), (1.0,))


def test_the_page_holds_every_place() -> None:
    made = PAGE.read_text(encoding="utf-8").split(MARKS[0])[1].split(MARKS[1])[0]
    assert [line.split("|")[1].strip() for line in made.strip().splitlines()[2:]] == [
        f"({x:g}, {y:g})" for x, y in PLACES_MM
    ]
    rms = np.array(
        [
            [float(cell.split(",")[0]) for cell in line.split("|")[2:6]]
            for line in made.strip().splitlines()[2:]
        ]
    )
    assert (np.diff(rms, axis=1) > 0).all()
