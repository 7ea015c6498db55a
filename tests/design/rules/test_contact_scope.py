"""What `check` says of designs that the contact model does not hold."""

import pytest

from optopad.design.preset import preset
from optopad.design.rules.check import check


def words_about(field, **changes):
    return [str(one) for one in check(preset("piacenza2017-pad").with_(**changes)) if one.field == field]


@pytest.mark.parametrize(
    ("thickness_mm", "said"),
    [
        (1.9, "outside the contact model"),
        (2.0, "outside the contact library"),
        (2.8, "outside the contact library"),
        (2.9, None),
        (17.0, None),
        (17.1, "outside the contact library"),
        (29.0, "outside the contact library"),
        (29.1, "outside the contact model"),
    ],
)
def test_a_layer_outside_library_or_model_is_told(thickness_mm, said):
    # 1 mm of black layer and a 3 mm tip: the library holds elastic depths of 3.9 to 18 mm, the model 3 to 30 mm
    found = " ".join(words_about("cavity.clear_thickness_mm", **{"cavity.clear_thickness_mm": thickness_mm}))
    for text in ("outside the contact model", "outside the contact library"):
        assert (text in found) == (text == said)
