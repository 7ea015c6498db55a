"""`optopad driver collect` on a simulated bench."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.design.press_protocol import load_protocol_file
from optopad.fabrication.driver_config import dump_driver_config
from optopad.fabrication.stage.stage import limits_of
from optopad.sims.readings.dataset import read_data
from optopad.verbs.driver.collect import protocol_presses
from tests.fabrication.driver.made_up_pad import pad_config, untouched
from tests.fabrication.stage.made_up_bench import bench
from tests.said import says

ROOT = Path(__file__).parents[3]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals")
TABLE = """x_mm,y_mm,depth_mm,set,place,ambient
10,12,-1,a,0,yes
10,12,2,a,0,yes
20,12,2,a,1,yes
14,20,2,b,0,no
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    text = dump_driver_config(preset("piacenza2017-pad"), [1e5] * 8, np.minimum(untouched(), 1023))
    (tmp_path / "driver.toml").write_text(text, encoding="utf-8")
    (tmp_path / "presses.csv").write_text(TABLE)
    return tmp_path


@pytest.mark.slow
def test_collect_presses_by_a_table_and_goes_on_with_the_rest(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with bench(has_board=True) as made:
        assert made.board_port is not None
        command = ["driver", "collect", "driver.toml", "--stage-port", made.stage_port.name, "--out", "a.nc"]
        command += [
            "--protocol",
            "presses.csv",
            "--port",
            made.board_port.name,
            "--settle",
            "0.05",
            "--rate",
            "200",
        ]
        assert main([*command, "--json"]) == 2
        assert "light differs between" in capsys.readouterr().err
        assert main([*command, "--only", "a", "--speed", "50", "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert (said["presses_made"], said["presses_kept"], said["presses_wanted"]) == (2, 2, 3)
        assert (said["file"], said["frames"], said["complete"]) == ("a.nc", 3, False)
        assert said["tip_at"] == pytest.approx([20, 12, -5], abs=0.02)
        assert main([*command, "--only", "b", "--speed", "50"]) == 2
        assert "--tip-at: a.nc" in capsys.readouterr().err
        assert main([*command, "--only", "b", "--tip-at", "20,12,-5", "--speed", "50"]) == 0
        told = capsys.readouterr().out
    assert "1 presses made" in told
    assert "3 of 3 are kept, 4 frames" in told
    data = read_data(folder / "a.nc")
    assert data.press_mm[-1] == pytest.approx([14, 20, 2], abs=0.02)  # M114's two decimals, of start and end
    assert sorted(file.name for file in folder.iterdir()) == ["a.nc", "driver.toml", "presses.csv"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--tip-at", "1,1,0", "--origin", "1,1,0"], "give the position"),
        (["--tip-at", "here"], "--tip-at: 'here' ... X,Y,DEPTH"),
        (["--protocol", "far.csv"], "press 0 of set 'collected': stage: x 90 mm is outside"),
        (["--protocol", "none.csv"], "none.csv: no such file"),
        (["--protocol", "piacenza2017"], "needs the design"),
        (["--protocol", "driver.toml"], "--protocol driver.toml: needs the design"),
    ],
)
def test_what_cannot_be_collected_is_refused_before_any_port_is_opened(
    options: list[str], told: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "far.csv").write_text("x_mm,y_mm,depth_mm\n90,1,1\n")
    command = ["driver", "collect", "driver.toml", "--stage-port", "nowhere", "--out", "a.nc"]
    assert main([*command, "--protocol", "presses.csv", *options]) == 2
    assert says(capsys.readouterr().err, told)
    assert not (folder / "a.nc.parts").exists()


def test_the_published_protocol_becomes_presses_of_its_sets_in_an_order_of_the_seed() -> None:
    design = preset("piacenza2017-pad")
    found = protocol_presses(design, "piacenza2017-quick", seed=1)
    said = load_protocol_file("piacenza2017-quick")
    assert [entry.name for entry in found.sets] == [one.name for one in said.sets]
    assert [len(places) for places in said.places_mm(design)] == [
        sum(press.set_number == number for press in found.presses) for number in range(len(found.sets))
    ]
    first = found.presses[0]
    assert [step[2] for step in first.steps_mm] == said.depth_mm.tolist()
    places = {press.steps_mm[0][:2] for press in found.presses if press.set_number == 0}
    assert places == {tuple(place) for place in said.places_mm(design)[0].tolist()}
    assert protocol_presses(design, "piacenza2017-quick", seed=1).digest == found.digest
    assert protocol_presses(design, "piacenza2017-quick", seed=2).digest != found.digest
    found.require_within(limits_of(pad_config().workspace))


@pytest.mark.slow
def test_a_full_disk_ends_it_with_the_place_of_the_tip(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_given: object, **_named: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("optopad.fabrication.stage.collection.np.savez", full)
    with bench(has_board=True) as made:
        assert made.board_port is not None
        command = ["driver", "collect", "driver.toml", "--stage-port", made.stage_port.name, "--out", "a.nc"]
        command += ["--protocol", "presses.csv", "--port", made.board_port.name, "--settle", "0"]
        assert main([*command, "--only", "a", "--speed", "50"]) == 2
        told = capsys.readouterr().err
        assert "No space left" in told
        assert "--tip-at 10,12,-5 or --origin" in told


@pytest.mark.slow
def test_ctrl_c_lifts_the_tip_keeps_whole_presses_and_is_no_failure(folder: Path) -> None:
    rows = [f"{x},{y},{depth}" for x in (8, 12, 16, 20, 24) for y in (8, 16, 24) for depth in (-1, 1, 3)]
    (folder / "many.csv").write_text("\n".join(["x_mm,y_mm,depth_mm", *rows]) + "\n")
    with bench(has_board=True) as made:
        assert made.board_port is not None
        command = ["driver", "collect", "driver.toml", "--stage-port", made.stage_port.name, "--out", "a.nc"]
        command += ["--protocol", "many.csv", "--port", made.board_port.name, "--settle", "0.1", "--json"]
        with subprocess.Popen(
            [sys.executable, "-m", "optopad", *command],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            try:
                while len(list(folder.glob("a.nc.parts/*.npz"))) < 2:
                    assert process.poll() is None
                    time.sleep(0.05)
                process.send_signal(signal.SIGINT)
                said, told = process.communicate(timeout=30)
            finally:
                process.kill()
        depth_mm = made.printer.here_mm()[2]
    assert process.returncode == 0, told
    assert depth_mm == pytest.approx(-5.0, abs=0.011)  # M114 has two decimals
    found = json.loads(said)
    assert not found["complete"]
    assert 2 <= found["presses_kept"] < 15
    assert len(read_data(folder / "a.nc").press_mm) == 3 * found["presses_kept"]
