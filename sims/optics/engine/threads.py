"""One piece of work a thread: compiled code that lets go of the interpreter runs side by side.

As many threads as numba is set to (`NUMBA_NUM_THREADS`, `numba.set_num_threads`). Numba's own parallel loops do the
same, but compile everything below them twice.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


def run_each(work: Callable[[int], object], count: int) -> None:
    """Call `work` with 0 to `count` - 1. What the first compiles the others wait for: Numba compiles behind a lock.

    An error, or an interruption, ends it as soon as the pieces under way are done.
    """
    import numba

    threads = min(int(numba.get_num_threads()), count)
    if threads < 2:
        for number in range(count):
            work(number)
        return
    pool = ThreadPoolExecutor(max_workers=threads)
    try:
        for _ in pool.map(work, range(count)):
            pass
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
