"""The table of speeds in docs/validation/light.md: every figure a ratio within one run, or beside one.

    python -m tests.validation.light.light_speed            some ten minutes on two otherwise idle cores
    python -m tests.validation.light.light_speed hits       only these rows, printed only: hits, walks, scan, start

The row of the optional tool Mitsuba says so where it is absent.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from platform import machine, python_version
from tempfile import TemporaryDirectory

from tests.bench.measures.benchmark_states import SURFACES, benchmark_scene, surface_of
from tests.bench.measures.closest_hits import engine_hits, plain_hits
from tests.bench.measures.forward_walk import Walked
from tests.bench.measures.scan_cost import scan
from tests.bench.measures.start_time import first_trace
from tests.bench.measures.surface_mesh import cosine_rays
from tests.bench.measures.walk_cost import (
    CENTRE_MM,
    DEPTH_MM,
    ToolMissingError,
    duel,
    mitsuba_walk,
    plain_walk,
)
from tests.sims.optics.surface.analytic import compact_dimple
from tests.validation.contact.contact_table import markdown_table, with_table
from tests.validation.light.light_table import PAGE

MARKS = "<!-- made by tests/validation/light/light_speed.py -->", "<!-- end of speeds -->"
HIT_RAYS = 1_000_000
Line = tuple[str, str]
OPPONENTS: Mapping[str, Callable[[], Walked]] = {
    "plain walk, Numba": plain_walk,
    "Mitsuba 3 loop, LLVM": mitsuba_walk,
}


def hits(rays: int = HIT_RAYS) -> Iterator[Line]:
    """Closest hits of 1 million rays at 3 mm depth, one thread."""
    press, lines = compact_dimple(DEPTH_MM), cosine_rays(benchmark_scene(), rays)
    mine = engine_hits(press, CENTRE_MM, lines).millions_per_second
    yield "closest hits, engine, analytic surface", f"{mine:.1f} M/s"
    contact = engine_hits(surface_of("contact")(DEPTH_MM), CENTRE_MM, lines).millions_per_second
    yield "closest hits, engine, contact surface", f"{contact:.1f} M/s"
    yield "closest hits, plain walk", f"{plain_hits(press, CENTRE_MM, lines).millions_per_second:.1f} M/s"


def walks(opponents: Mapping[str, Callable[[], Walked]] = OPPONENTS) -> Iterator[Line]:
    """To 0.5 % on the worst pair at 3 mm depth, one thread."""
    for name, walk in opponents.items():
        try:
            found = duel(walk())
        except ToolMissingError as missing:
            yield f"to 0.5 % on the worst pair, {name}", f"not measured: {missing}"
            continue
        yield (
            f"to 0.5 % on the worst pair, {name}",
            f"{found.walk_seconds:.1f} core-s at {found.segments_per_second / 1e6:.1f} M segments/s; "
            f"engine ({found.engine.setting}) {found.engine.seconds:.4f} core-s: {found.ratio:.0f}x",
        )


def scans(along: int = 11, depths: int = 51) -> Iterator[Line]:
    """121 places x 51 depths on two threads."""
    for surface in SURFACES:
        found = scan(surface, along, depths)
        yield (
            f"scan of {found.states} states, {surface}, standard",
            f"{found.core_minutes:.2f} core-min, {found.wall_seconds:.0f} s",
        )


def starts(warm_runs: int = 3, is_cold: bool = True) -> Iterator[Line]:
    """Fresh processes; without a cold one, the warm ones find what this machine has compiled."""
    with TemporaryDirectory() as folder:
        cache = Path(folder) if is_cold else None
        if is_cold:
            yield "import and first trace, nothing compiled yet", f"{first_trace(cache).seconds:.1f} s"
        warm = [first_trace(cache) for _ in range(warm_runs)]
    yield "import and first trace, compile cache warm", f"{min(one.seconds for one in warm):.2f} s"


PARTS: dict[str, Callable[[], Iterator[Line]]] = {
    "hits": hits,
    "walks": walks,
    "scan": scans,
    "start": starts,
}


def main(arguments: list[str]) -> None:
    """Measure; write the table if everything was measured."""
    lines = []
    before = os.getloadavg()[0]
    for part in arguments or PARTS:
        for line in PARTS[part]():
            print(" | ".join(line), file=sys.stderr, flush=True)
            lines.append(list(line))
    made = f"Python {python_version()}, {machine()}, {os.cpu_count()} cores; load of the machine before: {before:.1f}."
    table = f"{made}\n\n{markdown_table(['what', 'measured'], lines)}"
    print(table)
    if not arguments:
        PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), table, MARKS), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
