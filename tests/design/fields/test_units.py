import math

import pytest

from optopad.design.fields.quantity import lambertian_order


def test_sixty_degrees_is_the_lambertian_order_itself():
    assert lambertian_order(60.0) == 1.0


@pytest.mark.parametrize("half_angle_deg", [10.0, 35.5, 65.0, 80.0])
def test_the_law_falls_to_one_half_at_the_half_angle(half_angle_deg):
    """To the twelve decimals that the order is rounded to, times ln cos of 10 degrees at most 5."""
    cosine = math.cos(math.radians(half_angle_deg))
    assert cosine ** lambertian_order(half_angle_deg) == pytest.approx(0.5, abs=1e-11)
