"""Bounds as plots, JSON and netCDF: what a bundle holds of them."""

import json

import numpy as np
import pytest
import xarray as xr

from optopad.design.preset import preset
from optopad.sims.bounds.observability import bound_depths_mm, bounds_json
from optopad.sims.readings.readout import save_dataset
from optopad.sims.score.maps_file import bounds_dataset, provenance
from tests.sims.made_up_bounds import made_up_bounds


@pytest.fixture(scope="module")
def bounds():
    return made_up_bounds()


def test_json_has_no_infinities_and_blind_is_null(bounds):
    text = json.dumps(bounds_json(bounds), allow_nan=False)
    found = json.loads(text)
    assert found["location_mm"][0][0][0] is None
    assert found["location_error_mm"][0][0][0] is None
    assert found["location_mm"][1][0][0] == pytest.approx(0.02 / 0.7, rel=1e-4)
    assert found["worst_voxel"]["location_mm"] is None
    assert found["worst_loss"] == "R8"


def test_summaries_follow_from_the_maps(bounds):
    assert bounds.weight.sum() == pytest.approx(1.0)
    first_layer_share = 0.45 / 5.0 / 25
    assert bounds.blind_share == pytest.approx(first_layer_share)
    assert bounds.coverage.value == pytest.approx(1.0 - first_layer_share)
    assert bounds.dead_share.value == pytest.approx(first_layer_share)
    assert bounds.worst.depth_mm == 0.2
    assert np.isinf(bounds.worst.location_mm)


def test_maps_open_with_one_line_and_keep_units_and_blind_voxels(bounds, tmp_path):
    file = tmp_path / "maps.nc"
    save_dataset(bounds_dataset(bounds).assign_attrs(provenance(preset("piacenza2017-pad"), 3)), file)
    with xr.open_dataset(file) as maps:
        assert maps.location_bound.dims == ("y", "x", "depth")
        assert {
            name: values.attrs["units"] for name, values in maps.data_vars.items() if "bound" in name
        } == {name: "mm" for name in maps.data_vars if "bound" in name}
        assert np.isinf(maps.location_bound.sel(x=6.0, y=6.0, depth=0.2))
        assert maps.attrs["seed"] == 3
        assert maps.attrs["design_digest"] == preset("piacenza2017-pad").digest
        assert "numpy" in maps.attrs["versions"]


def test_bound_depths_leave_room_for_the_presses_beside_them():
    found = bound_depths_mm((0.2, 0.7, 1.5, 2.8), 2.0, 0.1)
    assert found == pytest.approx([0.2, 0.7, 1.5, 1.9])
    assert bound_depths_mm((0.2, 0.7), 0.4, 0.1) == pytest.approx([0.3])
