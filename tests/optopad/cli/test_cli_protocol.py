"""`optopad simulate --protocol`: a data set in the bundle, taken up where it was stopped; what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.design.press_protocol import load_protocol_file
from optopad.sims.readings import protocol as simulated
from optopad.sims.readings.dataset import read_data, require_design
from optopad.sims.readings.press_data import PressCurves
from tests.said import says

SMALL = """
name = "small"
approach = [{ from_mm = -1.0, to_mm = 2.0, step_mm = 0.5 }]
[[sets]]
name = "grid"
role = "train"
is_ambient = true
grid_mm = 10.0
[[sets]]
name = "dark"
role = "test"
is_ambient = false
random_places = 3
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    return tmp_path


@pytest.fixture
def made_up_light(monkeypatch):
    """Light that fades with depth, in place of a trace."""

    def curves(design, places_mm, *, depth_mm, on_step, **_):
        fade = np.exp(-np.asarray(depth_mm) * places_mm[:, :1] / 30.0)
        on_step(1, 1)
        return PressCurves(
            places_mm=places_mm, depth_mm=depth_mm, flux=fade[:, :, None, None] * np.full((8, 8), 3e-3)
        )

    monkeypatch.setattr(simulated, "traced_curves", curves)


def file_of(design: str, protocol: str = "small", seed: int = 0) -> Path:
    made = preset(design)
    return Path("outputs") / f"{made.name}-{made.digest[:8]}" / "sims" / f"data-{protocol}-{seed}.nc"


def test_a_protocol_makes_a_data_set_in_the_bundle(folder, capsys, made_up_light):
    assert main(["simulate", "piacenza2017-pad", "--protocol", "small.toml", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["protocol"]["points_per_press"] == 14
    assert said["file"] == str(file_of("piacenza2017-pad"))
    assert said["clipped"] is None
    data = read_data(Path(said["file"]))
    assert len(data) == said["samples"] == 14 * (9 + 3)
    assert require_design(data, preset("piacenza2017-pad")) == ()
    assert data.attributes["protocol"]["name"] == "small"
    manifest = json.loads((Path(said["file"]).parents[1] / "manifest.json").read_text(encoding="utf-8"))
    assert "sims/data-small-0.nc" in manifest["files"]
    assert [path.name for path in Path("outputs").iterdir()] == [Path(said["file"]).parents[1].name]


def test_a_stopped_run_is_taken_up_with_the_same_data(folder, capsys, made_up_light, monkeypatch):
    assert main(["simulate", "piacenza2017-pad", "--protocol", "small.toml", "--out", "whole"]) == 0
    presses = simulated.drawn_presses

    def stopped(*args, **kwargs):
        for number, press in enumerate(presses(*args, **kwargs)):
            if number == 5:
                raise KeyboardInterrupt
            yield press

    command = ["simulate", "piacenza2017-pad", "--protocol", "small.toml", "--json"]
    monkeypatch.setattr("optopad.verbs.simulate.drawn_presses", stopped)
    assert main(command) != 0
    assert not file_of("piacenza2017-pad").exists()
    monkeypatch.setattr("optopad.verbs.simulate.drawn_presses", presses)
    capsys.readouterr()
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["taken_up_presses"] == 5
    whole = Path("whole") / file_of("piacenza2017-pad").relative_to("outputs")
    np.testing.assert_array_equal(read_data(file_of("piacenza2017-pad")).counts, read_data(whole).counts)
    assert not list(Path("outputs").glob(".*"))


def test_a_run_stopped_before_the_bundle_is_in_its_place_loses_no_press(
    folder, capsys, made_up_light, monkeypatch
):
    def stopped(*_):
        raise KeyboardInterrupt

    command = ["simulate", "piacenza2017-pad", "--protocol", "small.toml", "--json"]
    with monkeypatch.context() as patch:
        patch.setattr("optopad.fabrication.bundle._swap", stopped)
        assert main(command) == 130
    capsys.readouterr()
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["taken_up_presses"] == 9 + 3
    assert not list(Path("outputs").glob(".*"))


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["--protocol", "piacenza2071"], "piacenza2017"),
        (["--protocol", "small.toml", "--press", "16,16,1"], "--press ... --protocol"),
        (["--fit"], "--fit: needs --protocol"),
        (["--protocol", "small.toml", "--set", "operating.max_depth_mm=1"], "2 mm, the ... for 1"),
        (
            [
                "--protocol", "small.toml", "--set", "noise.wall_unbonded_share=0.2",
                "--set", "surfaces.wall_finish=air_gap",
            ],
            "air gap already",
        ),
        (["--protocol", "small.toml", "--set", "noise.led_fluctuation=2"], "noise.led_fluctuation: 2 is refused"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_and_nothing_is_written(folder, capsys, made_up_light, command, message):
    assert main(["simulate", "piacenza2017-pad", *command]) == 2
    assert says(capsys.readouterr().err, message)
    assert not Path("outputs").exists()


def test_fit_leaves_out_what_is_too_deep(folder, capsys, made_up_light):
    command = ["simulate", "piacenza2017-pad", "--protocol", "small.toml", "--fit", "--json"]
    assert main([*command, "--set", "operating.max_depth_mm=1"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["protocol"]["points_per_press"] == 10


@pytest.mark.slow
def test_traced_walls_that_come_loose_change_signals_where_walls_mirror(folder):
    """The share that is loose shows, on the way back more than on the way in; black layer or none."""
    protocol = load_protocol_file(Path("small.toml"))
    place = protocol.sets[1].model_copy(update={"random_places": 1})
    one = protocol.model_copy(update={"sets": (place,), "curves": "coarse"})
    for black_mm in (1.0, 0.0):
        quiet = {
            f"noise.{name}": 0.0
            for name in ("read_noise_counts", "led_fluctuation", "gain_drift", "zero_offset_set_mm",
                         "zero_offset_place_mm", "retract_lag_mm", "position_error_mm")
        }  # fmt: skip
        design = preset("piacenza2017-pad").with_(
            **quiet, **{"noise.wall_unbonded_share": 0.5, "cavity.black_thickness_mm": black_mm}
        )
        data = simulated.draw(simulated.protocol_curves(design, one), seed=0)
        signal = data.signals()[:14].mean(axis=(1, 2))
        way_in, way_back = signal[:7], signal[7:][::-1]
        assert way_back[2] - way_in[2] > 2.0  # 0 mm: whole walls before, loose ones after
        assert way_back[-1] == pytest.approx(way_in[-1], abs=1.0)  # the turn


def test_clipped_channels_are_reported(folder, capsys, made_up_light):
    command = ["simulate", "piacenza2017-pad", "--protocol", "small.toml"]
    assert main([*command, "--set", "gain.target_counts=2000", "--set", "gain.feedback_ohm=common"]) == 0
    assert "warning   64 of 72 channels clip at 1023 counts" in capsys.readouterr().out
