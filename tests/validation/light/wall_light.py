"""What near walls change of light, and what tracing it costs: a table of docs/validation/walls.md.

    python -m tests.validation.light.wall_light            two minutes on one core

The paper's pad, presses traced with the centred shape and with the field of the walls (`correction_fields`), on one
thread. Changes are of the pairs of different walls, each over its own untouched signal; times are of the processor.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numba
import numpy as np
from numpy.typing import NDArray

from design.geometry.cavity import cavity_of
from design.geometry.pairs import direct_path_pairs
from design.preset import preset
from sims.cache.light_store import SIZE_VARIABLE, light_store
from sims.optics.accuracy import ACCURACIES, Accuracy
from sims.optics.tracing import correction_fields, trace
from tests.validation.contact.contact_table import markdown_table, with_table

FloatArray = NDArray[np.float64]

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "walls.md"
MARKS = "<!-- made by tests/validation/light/wall_light.py -->", "<!-- end of light -->"
PLACES_MM = ((6.0, 16.0), (8.0, 16.0), (10.0, 16.0), (12.0, 16.0), (16.0, 16.0), (6.0, 6.0), (8.0, 8.0))
DEPTHS_MM = (1.0, 2.0, 3.0, 4.0)


@dataclass(frozen=True, kw_only=True)
class Change:
    """Presses at one place.

    Attributes
    ----------
    rms, largest : (depth,) over pairs, of the change over the pair's untouched signal [-]
    claimed : (depth,) root mean square of the standard errors of both traces over the untouched signal [-]
    field_seconds, plain_seconds, with_field_seconds : processor time a state
    """

    place_mm: tuple[float, float]
    rms: FloatArray
    largest: FloatArray
    claimed: FloatArray
    field_seconds: float
    plain_seconds: float
    with_field_seconds: float

    @property
    def cost_ratio(self) -> float:
        """Time with the field, its making included, over time without."""
        return (self.with_field_seconds + self.field_seconds) / self.plain_seconds


def change_at(
    place_mm: tuple[float, float],
    depths_mm: tuple[float, ...] = DEPTHS_MM,
    accuracy: Accuracy = ACCURACIES["standard"],
) -> Change:
    """Trace one place both ways; light kept from earlier runs would make the times those of a disk."""
    if light_store() is not None:
        raise ValueError(f"set {SIZE_VARIABLE}=0: times of kept light are not those of tracing")
    design = preset("piacenza2017-pad")
    pairs = direct_path_pairs(cavity_of(design))
    untouched = trace(design, np.array([[*place_mm, 0.0]]), accuracy=accuracy).flux[0][pairs]
    presses = np.array([[*place_mm, depth] for depth in depths_mm])
    clock = [process_time()]
    fields = correction_fields(design, presses)
    clock.append(process_time())
    plain = trace(design, presses, accuracy=accuracy)
    clock.append(process_time())
    corrected = trace(design, presses, accuracy=accuracy, fields=fields)
    clock.append(process_time())
    change = (corrected.flux - plain.flux)[:, pairs] / untouched
    claimed = np.hypot(plain.standard_error, corrected.standard_error)[:, pairs] / untouched
    seconds = np.diff(clock) / len(presses)
    return Change(
        place_mm=place_mm,
        rms=np.sqrt(np.mean(change**2, axis=1)),
        largest=np.abs(change).max(axis=1),
        claimed=np.sqrt(np.mean(claimed**2, axis=1)),
        field_seconds=float(seconds[0]),
        plain_seconds=float(seconds[1]),
        with_field_seconds=float(seconds[2]),
    )


def table(changes: list[Change], depths_mm: tuple[float, ...] = DEPTHS_MM) -> str:
    """One line a place."""
    head = [
        "place mm",
        *(f"{depth:g} mm deep: rms, largest %" for depth in depths_mm),
        "core-s a state",
        "with field",
    ]
    body = [
        [
            f"({one.place_mm[0]:g}, {one.place_mm[1]:g})",
            *(f"{100 * rms:.1f}, {100 * most:.1f}" for rms, most in zip(one.rms, one.largest, strict=True)),
            f"{one.plain_seconds:.3f}",
            f"{one.with_field_seconds:.3f} + {one.field_seconds:.3f} ({one.cost_ratio:.1f}x)",
        ]
        for one in changes
    ]
    return markdown_table(head, body)


def main() -> None:
    """Make the table."""
    numba.set_num_threads(1)
    change_at((11.0, 9.0), DEPTHS_MM[:1])  # compiles, and lights the untouched pad
    text = table([change_at(place) for place in PLACES_MM])
    print(text)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main()
