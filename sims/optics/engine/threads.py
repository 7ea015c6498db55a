"""Run pieces of work in parallel threads; compiled code releases the interpreter lock.

The number of threads is numba's (`NUMBA_NUM_THREADS`, `numba.set_num_threads`). Numba's own parallel loops would do the
same, but compile every called function twice.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

_WAITING = threading.local()


@contextmanager
def between_pieces(call: Callable[[], None]) -> Iterator[None]:
    """Within this `with` block, call a function between the pieces of work that this thread waits for."""
    former = getattr(_WAITING, "call", None)
    _WAITING.call = call
    try:
        yield
    finally:
        _WAITING.call = former


def run_each(work: Callable[[int], object], count: int) -> None:
    """Call `work` in threads with each number from 0 to `count` - 1; the first call runs alone, as Numba compiles then.

    An error or an interruption ends the work as soon as the running pieces are done.
    """
    import numba

    attend = getattr(_WAITING, "call", None) or _nothing
    threads = min(int(numba.get_num_threads()), count)
    if threads < 2:
        for number in range(count):
            work(number)
            attend()
        return
    pool = ThreadPoolExecutor(max_workers=threads)
    try:
        for _ in pool.map(work, range(count)):
            attend()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _nothing() -> None:
    """Do nothing between pieces of work."""
