"""The lines of Python in the tutorial run as written, on a bundle's files."""

import re
import subprocess
import sys
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


CHECKS = """
assert place_mm.dims == ("y", "x")
assert place_mm.attrs["units"] == "mm"
assert one_pair.dims == ("press_depth",)
"""


def test_one_line_opens_the_maps_and_the_next_select_from_them(tmp_path):
    (tmp_path / "sims").mkdir()
    save_dataset(made_up_maps(), tmp_path / "sims" / "maps.nc")
    (block,) = re.findall(r"```python\n(.*?)```", TUTORIAL.read_text(encoding="utf-8"), flags=re.DOTALL)
    command = [sys.executable, "-c", block + CHECKS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
