"""The lines of Python in the tutorial run as written, on a bundle's files."""

import re
from pathlib import Path

import numpy as np
import xarray as xr

from design.preset import preset
from sims.bounds.maps_file import bounds_dataset, provenance
from sims.signal_file import save_dataset
from tests.sims.made_up_bounds import made_up_bounds

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial.md"


def made_up_maps():
    design = preset("piacenza2017-pad")
    bounds = made_up_bounds(design)
    depth = np.array([0.0, 1.0])
    counts = np.ones((len(bounds.y_mm), len(bounds.x_mm), 2, len(bounds.pairs)))
    readings = xr.Dataset(
        {"counts": (("y", "x", "press_depth", "pair"), counts, {"units": "counts"})},
        coords={"press_depth": depth, "pair": list(bounds.pairs)},
    )
    return bounds_dataset(bounds).merge(readings).assign_attrs(provenance(design, 0))


def test_one_line_opens_the_maps_and_the_next_select_from_them(tmp_path, monkeypatch):
    (tmp_path / "sims").mkdir()
    save_dataset(made_up_maps(), tmp_path / "sims" / "maps.nc")
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"```python\n(.*?)```", TUTORIAL.read_text(encoding="utf-8"), flags=re.DOTALL)
    names: dict[str, xr.Dataset | xr.DataArray] = {}
    exec(block, names)
    with names["maps"]:
        assert names["place_mm"].dims == ("y", "x")
        assert names["place_mm"].attrs["units"] == "mm"
        assert names["one_pair"].dims == ("press_depth",)
