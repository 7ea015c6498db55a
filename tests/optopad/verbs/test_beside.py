"""Work beside other work: its result comes back, its error is not lost, the block waits for it."""

import threading

import pytest

from optopad.work import beside


def test_the_block_and_the_work_go_on_together():
    met = threading.Barrier(2, timeout=10.0)  # either alone would wait for the other until it breaks
    with beside(met.wait) as made:
        met.wait()
        assert made() in (0, 1)


def test_an_error_of_the_work_leaves_the_block_even_if_nobody_asks_for_its_result():
    def broken():
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"), beside(broken):
        pass


def test_the_block_waits_for_the_work_when_it_breaks_itself():
    done = []
    with pytest.raises(ValueError, match="own"), beside(lambda: done.append(True)):
        raise ValueError("own")
    assert done == [True]
