"""Work in another process: its results and errors come back, and it ends with the block."""

import pytest

from optopad.work import beside

SERVED = """
import os
import time
from optopad.work import serve

def total(*numbers, start=0):
    print("a line that is no result")
    return sum(numbers, start)

def broken():
    raise OSError(28, "disk full", "sims/maps.nc")

def end():
    os._exit(3)

serve(total, broken, end, time.sleep)
"""


@pytest.fixture(autouse=True)
def served(tmp_path, monkeypatch):
    (tmp_path / "served.py").write_text(SERVED, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)


def test_results_and_errors_come_back_in_any_order():
    with beside("served") as other:
        first, second, third = (
            other.begin("total", 1, 2, start=3),
            other.begin("broken"),
            other.begin("total", 4),
        )
        with pytest.raises(OSError, match="disk full") as err:
            second()
        assert err.value.filename == "sims/maps.nc"
        assert (third(), first()) == (4, 6)


def test_a_process_that_ends_early_is_an_error_with_its_exit_code():
    with beside("served") as other:
        result = other.begin("end")
        with pytest.raises(RuntimeError, match="ended with 3"):
            result()


def test_the_process_ends_with_the_block_while_it_still_works():
    with beside("served") as other:
        other.begin("sleep", 60.0)
    assert other._process.poll() is not None
