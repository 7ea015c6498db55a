"""Two sizes of every benchmark: as its figures are published, and as small as it goes, to see that it runs at all.

With `--benchmark-disable` (`make bench-smoke`) the same code runs once with small arguments, and nothing else of this
folder does: what is no benchmark is among the tests. Its times mean nothing
then, so nothing that is said of time is asserted (`is_timed`); what a benchmark computes is asserted at both sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import pytest

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class BenchSize:
    """Which of the two sizes runs.

    Attributes
    ----------
    is_timed : whether times are measured, at full size
    """

    is_timed: bool

    def of(self, full: T, small: T) -> T:
        """The argument of this size."""
        return full if self.is_timed else small


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("benchmark_disable"):
        return
    here = Path(__file__).parent
    others = [
        item
        for item in items
        if here in item.path.parents and "benchmark" not in getattr(item, "fixturenames", ())
    ]
    items[:] = [item for item in items if item not in others]
    config.hook.pytest_deselected(items=others)


@pytest.fixture(scope="session")
def bench_size(request: pytest.FixtureRequest) -> BenchSize:
    return BenchSize(is_timed=not request.config.getoption("benchmark_disable"))
