"""Which inferred part heights agree with all of the paper's evidence: a table of docs/validation/reality.md.

    python -m tests.validation.verdict.heights      half an hour of one core; what is done is kept and taken up

The paper says neither heights nor the LED's emitting area. Of 48 combinations (4 heights of the LED, 4 of the
photodiode, 3 areas) those are kept that pass its thickness experiment on the pair preset: no deadband at 7 and 8 mm of
clear layer, one at 10.5 and 12 mm, and at 8 mm up to a quarter more signal than at 7. Of these the pad is judged, and
its quick prediction held against the published depth error at 5 mm. Nothing is fitted.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import optopad
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import program_digest
from optopad.sims.score.scoring import score
from tests.validation.contact.contact_table import markdown_table, with_table

PAGE = Path(__file__).parents[3] / "docs" / "validation" / "reality.md"
BUILD = Path(__file__).parents[3] / "build" / "validation" / "heights.json"
MARKS = "<!-- made by tests/validation/verdict/heights.py -->", "<!-- end of heights -->"
EMITTER_MM, RECEIVER_MM = (4.0, 4.5, 5.0, 5.5), (5.0, 5.5, 6.0, 6.5)
AREA_MM = (1.0, 2.0, 2.8)
"""Heights of the centres above the clear layer's bottom, sides of the LED's emitting area; the part's own band [mm]."""
CONTIGUOUS_MM, DEADBAND_MM = (7.0, 8.0), (12.0, 10.5)
"""Clear layers without a deadband and with one, by the paper."""
STRONGER = (1.0, 1.25)
""""Slightly stronger" at 8 mm than at 7: between these [-]."""
DEEP_MM = 5.0

Combination = tuple[float, float, float]


def with_heights(design: SensorDesign, of: Combination) -> SensorDesign:
    """A preset with other heights of LED and photodiode and another emitting area."""
    emitter, receiver, area = of
    part = design.emitters.part
    return design.with_(
        **{
            "emitters.height_mm": emitter,
            "receivers.height_mm": receiver,
            f"part_measurements.{part}.active_width_mm": area,
            f"part_measurements.{part}.active_height_mm": area,
        }
    )


def misses(of: Combination) -> str:
    """The first finding of the thickness experiment that a combination misses; empty where it passes all."""
    signal = {}
    for clear_mm in (*CONTIGUOUS_MM, *DEADBAND_MM):
        design = with_heights(preset("piacenza2017-pair"), of).with_(
            **{"cavity.clear_thickness_mm": clear_mm}
        )
        found = score(design, verdict_only=True)
        wanted = "CONTIGUOUS" if clear_mm in CONTIGUOUS_MM else "DEADBAND"
        if found.verdict != wanted:
            return f"{found.verdict} at {clear_mm:g} mm"
        signal[clear_mm] = float(found.pairs[0].curves.total[0])
    ratio = signal[8.0] / signal[7.0]
    return "" if STRONGER[0] < ratio < STRONGER[1] else f"signal at 8 mm {ratio:.2f} of that at 7 mm"


def of_pad(of: Combination) -> dict[str, Any]:
    """Usable depth and margin of the pad, and the depth error that its quick prediction has at the deepest press."""
    design = with_heights(preset("piacenza2017-pad"), of)
    found = score(design, verdict_only=True)
    assert found.pad_map is not None
    with TemporaryDirectory() as folder:
        errors = optopad.predict(design, out=folder).errors
    return {
        "verdict": found.verdict,
        "usable_mm": found.usable_depth_mm,
        "margin": found.pad_map.weakest.margin,
        "depth_error_mm": float(errors["depth_error"].sel(depth=DEEP_MM).values[0]),
    }


def judged() -> dict[Combination, dict[str, Any]]:
    """Every combination: what it misses, and what its pad does if it misses nothing."""
    done: dict[str, Any] = {}
    if (
        BUILD.exists()
        and (kept := json.loads(BUILD.read_text(encoding="utf-8")))["sources"] == program_digest()
    ):
        done = kept["done"]
    found = {}
    for of in product(EMITTER_MM, RECEIVER_MM, AREA_MM):
        name = " ".join(map(str, of))
        if name not in done:
            missed = misses(of)
            done[name] = {"missed": missed} | ({} if missed else of_pad(of))
            print(name, done[name], flush=True)
            BUILD.parent.mkdir(parents=True, exist_ok=True)
            BUILD.write_text(json.dumps({"sources": program_digest(), "done": done}), encoding="utf-8")
        found[of] = done[name]
    return found


def markdown(found: dict[Combination, dict[str, Any]]) -> str:
    """How many combinations pass, and a row for each that does."""
    passed = {of: one for of, one in found.items() if not one["missed"]}
    head = [
        "LED mm",
        "photodiode mm",
        "emitting area mm",
        "the pad",
        "usable depth mm",
        "least margin, sigma",
        f"median depth error at {DEEP_MM:g} mm",
    ]
    return "\n\n".join(
        [f"{len(passed)} of {len(found)} combinations pass.", markdown_table(head, list(_rows(passed)))]
    )


def _rows(passed: dict[Combination, dict[str, Any]]) -> Iterator[list[str]]:
    for (emitter, receiver, area), one in passed.items():
        yield [
            f"{emitter:g}",
            f"{receiver:g}",
            f"{area:g} x {area:g}",
            one["verdict"],
            f"{one['usable_mm']:.2f}",
            f"{one['margin']:.1f}",
            f"{one['depth_error_mm']:.3f}",
        ]


def main() -> None:
    """Judge, and write the table."""
    table = markdown(judged())
    print(table)
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main()
