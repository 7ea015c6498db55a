"""The command line says so when kernels are compiled, at once, and is silent when they come from the cache."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit

from optopad.screen.output import progress
from optopad.sims.compiling import compiling_told, is_there, listen_to_numba, tell_of

ROOT = Path(__file__).parents[2]
LINE = "compiling the light kernels, once on this machine: half a minute or more"


def kernel_under(name: str):
    """A kernel nobody has compiled yet, under the name of an entry point."""

    def trace_further(x):
        return x + 1

    trace_further.__name__ = name
    tell_of("flat_matrix")
    return njit(trace_further)


def test_compiling_is_told_when_it_begins_and_when_the_last_entry_point_is_done() -> None:
    listen_to_numba()
    told: list[float] = []
    helper, small, last = map(kernel_under, ("a_helper", "flat_matrix", "trace_further"))
    with compiling_told(told.append):
        helper(1)
        assert told == []  # compiled in no time
        small(1)
        assert told == [0.0]
        last(1)
        assert told == [0.0, 1.0]
        last(2)
        small(3)
    assert told == [0.0, 1.0]
    kernel_under("trace_further")(1)
    assert told == [0.0, 1.0]


def test_a_kernel_that_another_process_compiled_is_the_end_of_it() -> None:
    told: list[float] = []
    with compiling_told(told.append):
        is_there("flat_matrix")
        is_there("trace_further")
        assert told == []
        kernel_under("flat_matrix")(1)
        is_there("trace_further")
    assert told == [0.0, 1.0]


def test_compiling_that_is_cut_short_is_told_to_be_over() -> None:
    listen_to_numba()
    told: list[float] = []

    def cut_short() -> None:
        with compiling_told(told.append):
            kernel_under("flat_matrix")(1)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cut_short()
    assert told == [0.0, 1.0]


def test_machines_read_nothing_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    listen_to_numba()
    with progress(quiet=True):
        kernel_under("trace_further")(1)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")


def test_drawing_progress_needs_no_numba() -> None:
    program = (
        "import sys\nfrom optopad.screen.output import progress\n"
        "with progress(quiet=False) as step:\n    step('mold', 1.0)\n"
        "print('numba' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "False"
    assert LINE not in result.stderr
