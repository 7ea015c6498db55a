"""What goes to another process comes back equal; what could name code to run is refused."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from optopad.design.errors import DesignError
from optopad.design.preset import preset
from optopad.wire import packed, unpacked
from tests.sims.made_up_scores import dead_score


def sent(value):
    return unpacked(io.BytesIO(packed(value)))


def test_plain_values_designs_and_scores_come_back_equal():
    design = preset("piacenza2017-pad").with_(**{"cavity.clear_thickness_mm": 7.5})
    value = (1, 2.5, None, True, "text", [float("inf")], {(1, 2): Path("sims") / "maps.nc"}, np.float64(0.5))
    assert sent(value) == value
    assert sent(design).digest == design.digest
    score = dead_score()
    assert packed(sent(score)) == packed(score)


def test_arrays_keep_their_type_and_shape():
    arrays = [np.arange(6.0).reshape(2, 3), np.array([True, False]), np.zeros((0, 4), dtype=np.int64)]
    for array, found in zip(arrays, sent(arrays), strict=True):
        assert (found.dtype, found.shape) == (array.dtype, array.shape)
        np.testing.assert_array_equal(found, array)


def test_errors_of_files_and_of_this_package_come_back():
    found = sent(OSError(28, "disk full", "sims/maps.nc"))
    assert (type(found), found.errno, found.filename) == (OSError, 28, "sims/maps.nc")
    found = sent(DesignError("cavity: too small"))
    assert (type(found), str(found)) == (DesignError, "cavity: too small")


@pytest.mark.parametrize("value", [print, object(), ValueError("no"), [np.array([object()])]])
def test_other_objects_are_not_sent(value):
    with pytest.raises((TypeError, ValueError)):
        packed(value)


@pytest.mark.parametrize(
    "held",
    [
        {"class": ["subprocess", "Popen", {"args": ["true"]}]},
        {"class": ["optopad.work", "started", {"arguments": ["-c", "0"]}]},
        {"error": ["builtins", "eval", ["1"]]},
        {"error": ["builtins", "KeyError", ["1"]]},
    ],
)
def test_a_line_that_names_something_else_is_refused(held):
    with pytest.raises((TypeError, AttributeError)):
        unpacked(io.BytesIO(json.dumps([0, 0, held]).encode() + b"\n"))


def test_a_line_that_is_cut_off_is_an_end():
    for held in (b"", b"[0, 0, 1]"):
        with pytest.raises(EOFError):
            unpacked(io.BytesIO(held))
