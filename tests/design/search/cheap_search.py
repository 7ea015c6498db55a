"""A search whose objective costs nothing: for tests in which the physics does not matter.

As a program it is a worker: `python cheap_search.py URL TRIALS SAMPLER SHARED DELAY_S`.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from optopad.design.preset import preset
from optopad.design.search.explore import Findings, explore
from optopad.design.search.improve import Judged, Limit
from optopad.design.search.space import SearchSpace, space_from
from optopad.design.spec import SensorDesign


def cheap_space(sampler: str = "tpe", **changes: object) -> SearchSpace:
    step = 1.0 if sampler == "grid" else 0.5
    fields = [
        {"path": "cavity.clear_thickness_mm", "low": 6.0, "high": 12.0, "step": step},
        {"path": "emitters.height_mm", "low": 3.0, "high": 6.0, "step": step},
        {"path": "layout.0.count", "choices": [1, 3]},
    ]
    document = {
        "name": "cheap",
        "base": preset("piacenza2017-pair").model_dump(mode="json"),
        "fields": fields,
        "objectives": [{"figure": "evenness"}, {"figure": "pad_height_mm"}],
        "constraints": [{"figure": "strength", "at_least_base": 0.5}],
        "search": {"sampler": sampler, "trials": 30, "seed": 3, "batch": 4},
    }
    return space_from(document | changes, where="cheap.toml")


def bowl(design: SensorDesign, limits: tuple[Limit, ...]) -> Judged:
    """Evenness is best at 9 mm and 4.5 mm; strength falls with thickness; one count is refused."""
    thickness, height = design.cavity.clear_thickness_mm, design.emitters.height_mm
    if thickness > 11.0:
        return Judged(reason="too thick to be judged")
    figures = {
        "evenness": 1.0 / (1.0 + (thickness - 9.0) ** 2 + (height - 4.5) ** 2),
        "pad_height_mm": thickness + design.cavity.black_thickness_mm,
        "strength": 8.0 / thickness,
    }
    return Judged(figures=figures, verdict="CONTIGUOUS")


def outcome(found: Findings) -> list[tuple[str, tuple[float, ...]]]:
    """What two searches must agree in: every design with its figures, in the order of proposal."""
    return [
        (one.digest, tuple(float(value or 0.0) for value in one.judged.figures.values()))
        for one in found.tried
    ]


def main() -> None:
    url, trials, sampler, is_shared, delay_s = sys.argv[1:6]

    def slow(design: SensorDesign, limits: tuple[Limit, ...]) -> Judged:
        time.sleep(float(delay_s))
        return bowl(design, limits)

    def tell(found: Findings, _: object) -> None:
        print(len(found.tried), flush=True)

    explore(
        cheap_space(sampler),
        slow,
        url,
        trials=int(trials),
        is_shared=is_shared == "shared",
        on_tried=tell,
        heartbeat_s=1,
    )


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[3]))
    main()
