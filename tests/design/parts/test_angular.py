"""Angular tables of data sheets: linear in the angle, 0 at 90 degrees, refused where they are no tables."""

import numpy as np
import pytest
from pydantic import ValidationError

from optopad.design.parts.angular import AngularTable


def table(angle_deg, relative):
    return AngularTable(
        angle_deg=tuple(angle_deg), relative=tuple(relative), source="sheet, fig. 4", confidence="read"
    )


def test_a_table_is_linear_in_the_angle_between_its_points():
    shown = table((0.0, 30.0, 90.0), (100.0, 70.0, 10.0))
    assert shown.at(np.array([0.0, 15.0, 30.0, 60.0, 90.0])) == pytest.approx([100.0, 85.0, 70.0, 40.0, 10.0])


def test_beyond_its_last_angle_a_table_falls_linearly_to_nothing_at_90():
    assert table((0.0, 60.0), (1.0, 0.6)).at(np.array([75.0, 90.0])) == pytest.approx([0.3, 0.0])


def test_the_half_angle_is_where_half_of_the_axis_is_left():
    assert table((0.0, 50.0, 70.0), (2.0, 1.2, 0.8)).half_angle_deg() == pytest.approx(60.0)
    assert table((0.0, 60.0), (1.0, 0.8)).half_angle_deg() == pytest.approx(60.0 + 30.0 * 3 / 8)
    batwing = table((0.0, 50.0, 60.0, 80.0), (1.0, 1.5, 1.5, 0.0))
    assert batwing.half_angle_deg() == pytest.approx(60.0 + 20.0 * 2 / 3)
    assert table((0.0, 90.0), (1.0, 0.8)).half_angle_deg() == 90.0


@pytest.mark.parametrize(
    ("angle_deg", "relative", "message"),
    [
        ((0.0, 10.0), (1.0,), "at least 2"),
        ((0.0, 10.0, 20.0), (1.0, 0.9), "angle_deg has 3 entries, relative 2"),
        ((5.0, 10.0), (1.0, 0.9), "starts at 5; start at 0"),
        ((0.0, 20.0, 20.0), (1.0, 0.9, 0.8), "must rise"),
        ((0.0, 95.0), (1.0, 0.0), "90"),
        ((0.0, 90.0), (1.0, -0.1), "to 0"),
        ((0.0, 90.0), (0.0, 0.0), "0 at every angle"),
        ((0.0, 90.0), (1.0, float("nan")), "finite"),
    ],
)
def test_what_is_no_table_is_refused(angle_deg, relative, message):
    with pytest.raises(ValidationError, match=message):
        table(angle_deg, relative)
