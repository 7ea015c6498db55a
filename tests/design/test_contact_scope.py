"""What `check` says of designs that the contact model does not hold."""

import pytest

from design.preset import preset
from design.rules import check


def words_about(field, **changes):
    return [str(one) for one in check(preset("piacenza2017-pad").with_(**changes)) if one.field == field]


@pytest.mark.parametrize(
    ("thickness_mm", "is_told"), [(2.8, True), (2.9, False), (17.0, False), (17.1, True)]
)
def test_a_layer_outside_1_3_to_6_tip_radii_is_told(thickness_mm, is_told):
    # 1 mm of black layer and a 3 mm tip: elastic depths of 3.9 to 18 mm are modelled
    found = words_about("cavity.clear_thickness_mm", **{"cavity.clear_thickness_mm": thickness_mm})
    assert any("outside the contact model" in text for text in found) == is_told
