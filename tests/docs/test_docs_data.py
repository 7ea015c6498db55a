"""The lines of Python in the tutorial and beside the learners run as written, on a bundle's files and on a model's."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from optopad.design.fields.base import known_values
from optopad.design.preset import PRESETS, preset
from optopad.design.spec import SensorDesign
from optopad.design.spec.sensor import Noise
from optopad.sims.learning.inference.model_file import save_model
from optopad.sims.readings.readout import save_dataset
from optopad.sims.score.maps_file import bounds_dataset, provenance
from tests.docs.field_text import Field, design_schema, sections
from tests.docs.preset_table import preset_picture
from tests.docs.reference_pages import FOLDER, PAGES, PICTURES, page_text
from tests.sims.learning.made_up_models import made_up_kernel_ridge
from tests.sims.made_up_bounds import made_up_bounds

DOCS = Path(__file__).parents[2] / "docs"
TUTORIAL = DOCS / "tutorials" / "design-to-bench.md"
LEARNING = DOCS / "how-to" / "train-learner.md"


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


def test_a_few_lines_answer_by_a_model_with_numpy_alone(tmp_path):
    save_model(tmp_path / "paper.optomodel", made_up_kernel_ridge())
    (block,) = re.findall(r"```python\n(.*?)```", LEARNING.read_text(encoding="utf-8"), flags=re.DOTALL)
    checks = "\nassert found.press_mm.shape == (1, 3)\nimport sys\nassert 'scipy' not in sys.modules"
    done = subprocess.run(
        [sys.executable, "-c", block + checks], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "nan" in done.stdout  # kernel ridge does not know its deviations


PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "simulate-data-set.md"


def test_every_parameter_stands_in_the_table_with_its_default() -> None:
    text = PAGE.read_text(encoding="utf-8")
    table = text[text.index("| `noise.` |") : text.index('"Bounded" means')]
    rows = dict(re.findall(r"^\| `(\w+)` \| (\S+) \|", table, flags=re.MULTILINE))
    said = {name: None if value == "none" else json.loads(value) for name, value in rows.items()}
    assert said == {name: getattr(Noise(), name) for name in Noise.model_fields}


def all_fields() -> list[Field]:
    return [field for _, _, fields in sections(design_schema()) for field in fields]


def test_a_value_that_set_takes_has_its_path_on_the_page() -> None:
    paths = {re.sub(r"\.\d+\.", ".N.", path) for path in known_values(SensorDesign)}
    shown = {field.path for field in all_fields()} | {f"catalog.{field.path}" for field in all_fields()}
    plain = {path for path in paths if not re.search(r"[<{*\[]", path)}
    assert {path for path in plain if not path.startswith(("catalog", "layout"))} - shown == set()


def test_every_field_has_a_meaning() -> None:
    assert [field.path for field in all_fields() if not field.meaning] == []


@pytest.mark.parametrize("name", PAGES)
def test_the_page_in_the_repository_is_current(name: str) -> None:
    is_current = (FOLDER / name).read_text(encoding="utf-8") == page_text(name)
    assert is_current, f"docs/reference/{name} is out of date; renew it: python -m tests.docs.reference_pages"


def test_the_pictures_of_the_presets_are_current() -> None:
    shown = {path.stem: path.read_text(encoding="utf-8") for path in PICTURES.iterdir()}
    assert shown == {name: preset_picture(preset(name)) for name in PRESETS}, "renew them as the pages"
