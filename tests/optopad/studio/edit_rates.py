"""How soon the studio answers: `python -m tests.optopad.studio.edit_rates`.

50 edits of the paper's pad, each waited for: to new curves, to a new draft map (seconds, middle and 95th percentile).
Then 200 edits in 20 s: what is left running, and the memory at the end over that at the start.
"""

from __future__ import annotations

import gc
import os
import queue
import time
from collections.abc import Iterator

import numpy as np

from optopad.studio.design_file import DesignFile
from optopad.studio.session import Session
from optopad.studio.workshop import Curves, LiveVerdict, Request, Result, Workshop

EDITS, BURST, BURST_S = 50, 200, 20.0


def edits(session: Session, count: int, seed: int) -> Iterator[str]:
    """Edits as a person makes them: thickness, heights, parts dragged, the ring's pitch, a catalogue value."""
    random = np.random.default_rng(seed)
    for number in range(count):
        match number % 5:
            case 0:
                session.set_field("cavity.clear_thickness_mm", round(8.0 + 3.0 * random.random(), 2))
            case 1:
                session.set_field("receivers.height_mm", round(5.5 + random.random(), 2))
            case 2:
                name = f"R{1 + random.integers(8)}"
                part = next(one for one in _parts(session) if one.name == name)
                session.move_part(name, along_mm=part.along_mm + random.choice([-0.4, 0.4]))
            case 3:
                session.set_field("emitters.height_mm", round(4.5 + random.random(), 2))
            case 4:
                session.set_field("elastomer.mixing_ratio", round(12.0 + 12.0 * random.random(), 1))
        if session.now.errors:
            session.undo()
        yield session.now.words


def _parts(session: Session) -> tuple:
    from optopad.design.shape.cavity import cavity_of

    return cavity_of(session.design).parts


def _wait(answers: queue.Queue[Result], kind: type, digest: str) -> Result:
    while True:
        found = answers.get(timeout=120.0)
        if isinstance(found, kind) and found.digest == digest:
            return found


def answer_times(seed: int, count: int = EDITS) -> tuple[list[float], list[float]]:
    """Seconds from an edit to new curves and to a new draft map, edit by edit."""
    session, answers = Session(DesignFile("piacenza2017-pad")), queue.Queue()
    shop = Workshop(answers.put)
    shop.start()
    shop.want(Request(design=session.design, press=session.press, is_thorough=False))
    _wait(answers, LiveVerdict, session.design.digest)  # kernels are compiled or loaded
    to_curves, to_map = [], []
    for _ in edits(session, count, seed):
        began = time.perf_counter()
        shop.want(Request(design=session.design, press=session.press, is_thorough=False))
        _wait(answers, Curves, session.design.digest)
        to_curves.append(time.perf_counter() - began)
        _wait(answers, LiveVerdict, session.design.digest)
        to_map.append(time.perf_counter() - began)
        time.sleep(0.3)
    shop.close()
    return to_curves, to_map


def burst(seed: int, count: int = BURST, seconds: float = BURST_S) -> tuple[int, float, float]:
    """Jobs running after many edits, memory gained [MB], and the time from the last edit to its curves [s]."""
    session, answers = Session(DesignFile("piacenza2017-pad")), queue.Queue()
    shop = Workshop(answers.put)
    shop.start()
    shop.want(Request(design=session.design, press=session.press))
    _wait(answers, LiveVerdict, session.design.digest)
    gc.collect()
    before = _memory_mb()
    began = time.perf_counter()
    for number, _ in enumerate(edits(session, count, seed)):
        shop.want(Request(design=session.design, press=session.press))
        time.sleep(max(began + (number + 1) * seconds / count - time.perf_counter(), 0.0))
    running, last = shop.running_jobs, time.perf_counter()
    _wait(answers, Curves, session.design.digest)
    waited = time.perf_counter() - last
    _wait(answers, LiveVerdict, session.design.digest)
    while not answers.empty():
        answers.get()
    gc.collect()
    gained = _memory_mb() - before
    shop.close()
    return running, gained, waited


def _memory_mb() -> float:
    with open(f"/proc/{os.getpid()}/statm", encoding="ascii") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Measure and tell, of edits that no earlier run has traced: light is found again on disk."""
    seed = time.time_ns() % 2**31
    for name, times in zip(("curves", "draft map"), answer_times(seed), strict=True):
        middle, high = np.percentile(times, [50, 95])
        print(
            f"edit to {name}: {middle:.2f} s in the middle, {high:.2f} s at the 95th percentile of {len(times)}"
        )
    running, gained, waited = burst(seed + 1)
    print(
        f"{BURST} edits in {BURST_S:g} s: {running} job running, {gained:+.0f} MB, curves {waited:.2f} s after the last"
    )


if __name__ == "__main__":
    main()
