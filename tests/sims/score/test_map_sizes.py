"""How many places and depths a map has, and at which light."""

import pytest

import optopad.sims.score.judge as stages
from optopad.design.draft import Draft
from optopad.design.preset import preset
from optopad.sims.optics.accuracy import ACCURACIES
from optopad.sims.score.judge import Judge
from optopad.sims.verdict.presses import MAP_ACCURACY

PAD = preset("piacenza2017-pad")


class AskedError(Exception):
    """Ends the map once its light is asked for."""


@pytest.fixture
def asked(monkeypatch):
    found = {}

    def never_traced(_design, places_mm, depth_mm, *, accuracy, **_rest):
        found.update(places=len(places_mm), depths=len(depth_mm), accuracy=accuracy)
        raise AskedError

    monkeypatch.setattr(stages, "map_light", never_traced)
    return found


@pytest.mark.parametrize(
    ("settings", "places", "fewest_depths", "accuracy"),
    [
        ("score", 25, 26, MAP_ACCURACY),
        ("full", 121, 51, MAP_ACCURACY),
        ("fine", 121, 51, ACCURACIES["standard"]),
    ],
)
def test_a_full_map_has_121_places_and_51_depths_at_least(asked, settings, places, fewest_depths, accuracy):
    with pytest.raises(AskedError):
        _ = Judge(Draft.of(PAD), settings).pad_map
    assert asked["places"] == places
    assert asked["depths"] >= fewest_depths
    assert asked["accuracy"] == accuracy
