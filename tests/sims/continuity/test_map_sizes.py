"""How many places and depths a map has, and at which light."""

import pytest

import sims.continuity.map_judging as continuity
from design.geometry.cavity import cavity_of
from design.preset import preset
from sims.optics.accuracy import ACCURACIES
from sims.verdict.presses import MAP_ACCURACY

PAD = preset("piacenza2017-pad")


class AskedError(Exception):
    """Ends the map once its light is asked for."""


@pytest.fixture
def asked(monkeypatch):
    found = {}

    def never_traced(_design, places_mm, depth_mm, *, accuracy, **_rest):
        found.update(places=len(places_mm), depths=len(depth_mm), accuracy=accuracy)
        raise AskedError

    monkeypatch.setattr(continuity, "map_light", never_traced)
    return found


@pytest.mark.parametrize(
    ("fine", "full", "places", "fewest_depths", "accuracy"),
    [
        (False, False, 25, 26, MAP_ACCURACY),
        (False, True, 121, 51, MAP_ACCURACY),
        (True, False, 121, 51, ACCURACIES["standard"]),
        (True, True, 121, 51, ACCURACIES["standard"]),
    ],
)
def test_a_full_map_has_121_places_and_51_depths_at_least(asked, fine, full, places, fewest_depths, accuracy):
    with pytest.raises(AskedError):
        continuity.judged_map(
            PAD, cavity_of(PAD), None, fine=fine, full=full, seed=0, tell=lambda _stage, _share: None
        )
    assert asked["places"] == places
    assert asked["depths"] >= fewest_depths
    assert asked["accuracy"] == accuracy
