"""The Python front door: what `import optopad` gives, quickly, with results that show themselves."""

import json
import subprocess
import sys
from html import unescape
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import optopad
from optopad.design.errors import DesignError, InputError
from optopad.fabrication.bundle import bundle_name
from optopad.fabrication.driver_config import dump_driver_config
from optopad.screen.prediction import PredictedAccuracy, Prediction, accuracy_of
from optopad.screen.score import Score
from optopad.sims.learning.tables import JudgedPresses
from optopad.sims.score import scoring
from optopad.verbs import compare as comparing
from optopad.verbs import sweep as sweeping
from tests.sims.made_up_scores import contiguous_score, dead_score, out_of_scope_score

ROOT = Path(__file__).parents[2]
PAIR = optopad.load("piacenza2017-pair")
THICK = PAIR.with_(**{"cavity.clear_thickness_mm": 10.0})


def made_up(design, **_):
    return (dead_score if design.cavity.clear_thickness_mm > 8 else contiguous_score)(design)


@pytest.fixture
def judged(monkeypatch):
    """Made-up scores in place of the physics."""
    monkeypatch.setattr(scoring, "score", made_up)
    monkeypatch.setattr(sweeping, "_judged", lambda variant, *_, **__: made_up(variant))
    monkeypatch.setattr(comparing, "_judged", made_up)


def picture_in(html):
    """The SVG inside a result's HTML, parsed."""
    start, end = html.index("<svg"), html.rindex("</svg>") + len("</svg>")
    return ElementTree.fromstring(html[start:end])


def test_import_loads_neither_the_physics_nor_the_specification():
    heavy = (
        "numpy",
        "pydantic",
        "xarray",
        "matplotlib",
        "numba",
        "mujoco",
        "cadquery",
        "sklearn",
        "scipy",
        "typer",
    )
    program = (
        f"import optopad, sys, json; print(json.dumps([name for name in {heavy} if name in sys.modules]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == []


@pytest.mark.parametrize("name", optopad.presets())
def test_every_preset_loads_fits_and_keeps_its_digest_on_disk(name, tmp_path):
    design = optopad.load(name)
    assert optopad.check(design).ok
    assert optopad.load(optopad.save(design, tmp_path / "mine.toml")).digest == design.digest


def test_what_does_not_load_is_refused_with_a_way_out():
    with pytest.raises(InputError, match="did you mean piacenza2017-pair"):
        optopad.load("piacenza2017-pear")
    with pytest.raises(DesignError, match="clear_thickness_mm"):
        optopad.load("piacenza2017-pair", cavity__clear_thickness_mm=1000.0)


def test_a_sensor_takes_what_driver_read_takes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    design = optopad.load("piacenza2017-pad", name="mine")
    folder = tmp_path / "outputs" / bundle_name(design) / "fabrication"
    folder.mkdir(parents=True)
    (folder / "driver.toml").write_text(dump_driver_config(design, 1e5), encoding="utf-8")
    for named in (optopad.save(design, "mine.toml"), folder, folder.parent, str(folder / "driver.toml")):
        config = optopad.Sensor(named, "loop://").config
        assert (config.digest, config.gain.counts_per_flux) == (design.digest, 1e5), named
    assert optopad.Sensor("piacenza2017-pad", "loop://").config.gain.counts_per_flux is None  # has no bundle
    with pytest.raises(InputError, match="did you mean piacenza2017-pad"):
        optopad.Sensor("piacenza2017-bad")


def test_a_check_tells_errors_from_warnings_and_shows_both():
    found = optopad.check(PAIR.with_(**{"receivers.height_mm": 9.5}))
    assert not found.ok
    assert {one.severity for one in found.errors} == {"error"}
    assert len(found.errors) + len(found.warnings) == len(found.findings)
    assert "receivers.height_mm" in repr(found)
    assert found._repr_html_().count("<tr>") == 1 + len(found.findings)


def test_a_score_has_verdict_figures_and_the_document_of_the_bundle(judged):
    found = optopad.score(THICK)
    assert (found.verdict, found.deadbands_mm) == ("DEADBAND", dead_score(THICK).deadbands_mm)
    assert found.deadband_mm == pytest.approx(sum(end - start for start, end in found.deadbands_mm))
    assert found.to_dict() == dead_score(THICK).to_json()
    assert repr(found).splitlines()[1].startswith("verdict     DEADBAND: E2-R2 does not resolve ")


def test_plots_of_a_score_take_axes_or_make_them(judged):
    found = optopad.score(THICK)
    own = found.plot_signal()
    assert found.plot_signal(found.pairs[0], ax=own) is own
    for plot in (found.plot_pairs, found.plot_map, found.plot_margin, found.plot_tolerance):
        ax = plot()
        assert ax.get_xlabel() or ax.get_ylabel()
        from matplotlib import pyplot as plt

        plt.close("all")


def test_out_of_scope_says_why_and_has_no_map():
    found = Score(design=PAIR, found=out_of_scope_score(PAIR))
    assert found.reason in unescape(found._repr_html_())
    with pytest.raises(InputError, match="nothing was computed"):
        found.maps  # noqa: B018


def test_a_sweep_is_a_table_over_the_values(judged, tmp_path):
    found = optopad.sweep(PAIR, "cavity.clear_thickness_mm", [8.0, 10.0], out=tmp_path)
    assert found.verdicts == ("CONTIGUOUS", "DEADBAND")
    assert found.table["cavity.clear_thickness_mm"].values.tolist() == [8.0, 10.0]
    at_10 = found.table.sel({"cavity.clear_thickness_mm": 10.0})
    assert (float(at_10.usable_depth_mm), str(at_10.headline.values)) == (5.0, "DEADBAND")
    assert "usable [mm]" in found._repr_html_()
    assert found.table.deadband_mm.values[0] == 0.0
    assert found.table.deadband_mm.values[1] > 0.0
    assert found._repr_html_().count("<tr>") == 3


def test_a_comparison_names_what_differs_and_who_is_better(judged, tmp_path):
    found = optopad.compare({"thin": PAIR, "thick": THICK}, out=tmp_path)
    assert found.changes == {"cavity.clear_thickness_mm": (8.0, 10.0)}
    assert found.verdicts == {"thin": "CONTIGUOUS", "thick": "DEADBAND"}
    assert found.winners["deadband"] == "thin"
    assert picture_in(found._repr_html_()).tag.endswith("svg")


def presses_off_by(location_mm, depths_mm=(0.5, 1.0, 2.0), places=4):
    """Samples that are all found, each told beside its place by the same length."""
    places_mm = np.repeat(np.arange(5.0, 5.0 + places), len(depths_mm))
    press = np.column_stack([places_mm, places_mm, np.tile(depths_mm, places)])
    return JudgedPresses(
        press_mm=press,
        said_mm=press + np.array([location_mm, 0.0, 0.02]),
        is_found=np.ones(len(press), dtype=bool),
        place_number=np.repeat(np.arange(places), len(depths_mm)),
        session_number=np.zeros(len(press), dtype=np.int64),
    )


def test_a_prediction_has_tables_with_named_axes(tmp_path):
    model = accuracy_of("kernel-ridge", "random", False, [presses_off_by(0.3)])
    found = Prediction(
        design=PAIR, found=PredictedAccuracy(name="pad", digest=None, found=(model,)), folder=tmp_path
    )
    assert found.errors.location_error.dims == ("learner", "depth")
    assert float(found.errors.location_error.sel(depth=1.0)[0]) == pytest.approx(0.3)
    assert float(found.touch.sel(depth=1.0)[0]) == 1.0
    assert np.isnan(found.errors.location_error.sel(depth=5.0)[0])
    assert found.models == {}
    assert picture_in(found._repr_html_()).tag.endswith("svg")


@pytest.mark.full
def test_the_maps_of_a_real_score_are_those_of_the_bundle(tmp_path):
    import xarray as xr

    made = optopad.run(optopad.load("piacenza2017-pair"), out=tmp_path)
    assert made.report.is_file()
    assert made.driver.is_file()
    again = optopad.score(made.score.design)
    with xr.open_dataset(made.folder / "sims" / "maps.nc") as stored:
        for name in again.maps.data_vars:
            np.testing.assert_array_equal(again.maps[name].values, stored[name].values, err_msg=str(name))
    assert again.to_dict() == json.loads((made.folder / "sims" / "score.json").read_text(encoding="utf-8"))


def test_changes_on_loading_are_those_of_with():
    assert optopad.load("piacenza2017-pair", cavity__clear_thickness_mm=10.0).digest == THICK.digest
