"""Work on a thread of its own: light is traced outside Python, so pictures are drawn beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

Made = TypeVar("Made")


@contextmanager
def beside(work: Callable[[], Made]) -> Iterator[Callable[[], Made]]:
    """Start work; what is yielded waits for it and gives what it made, or raises what it raised.

    The block is not left before the work is done, and an error of the work leaves it at the latest then.
    """
    with ThreadPoolExecutor(max_workers=1) as pool:
        started = pool.submit(work)
        yield started.result
        started.result()
