"""Search throughput on two cores: 3,000 designs of the pair an hour, 500 of the pad, at search accuracy.

Core-seconds are counted, not the clock, so that a busy machine does not decide. No design is stopped early by a limit,
which is the worst case of a search; the figures are of the first designs, the base among them.
"""

from __future__ import annotations

import functools
import time

import pytest

from optopad.design.search.explore import explore
from optopad.design.search.improve import Judged
from optopad.design.search.space import load_space
from optopad.sims.score.objective import judge

CORES = 2
HOUR_S = 3600.0


def core_seconds(name: str, count: int, folder) -> float:
    """Core-seconds a design, Optuna and its database included, mean over designs that are judged to the end [s]."""
    space = load_space(name)
    wanted = (*(objective.figure for objective in space.objectives), "strength", "verdict")
    objective = functools.partial(judge, wanted=wanted)
    objective(space.base, ())  # compiles, and fills what designs share
    free = space.model_copy(update={"constraints": ()})
    spent = []

    def timed(design, limits) -> Judged:
        judged = objective(design, ())
        if not judged.reason:
            spent.append(time.process_time())
        return judged

    started = time.process_time()
    explore(free, timed, f"sqlite:///{folder / 'study.db'}", trials=count)
    return (time.process_time() - started) / max(1, len(spent) - 1)  # less the base design, judged before


@pytest.mark.parametrize(("name", "count", "an_hour"), [("pair-heights", 16, 3000), ("pad-layout", 5, 500)])
def test_designs_an_hour(benchmark, bench_size, tmp_path, monkeypatch, name, count, an_hour):
    monkeypatch.setenv("OPTOPAD_LIGHT_CACHE_MB", "0")
    seconds = benchmark.pedantic(core_seconds, args=(name, bench_size.of(count, 2), tmp_path), rounds=1)
    benchmark.extra_info |= {"core_seconds": seconds, "designs_an_hour": CORES * HOUR_S / seconds}
    print(f"{name}: {seconds:.2f} core-s a design, {CORES * HOUR_S / seconds:.0f} an hour on {CORES} cores")
    assert not bench_size.is_timed or CORES * HOUR_S / seconds >= an_hour
