"""`optopad driver read --model` against a simulated board."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.fabrication.driver.simulated.finger import FingerPath
from optopad.fabrication.driver.simulated.port import FakePort
from optopad.fabrication.driver_config import dump_driver_config
from optopad.sims.learning.inference.model_file import save_model
from tests.fabrication.driver.made_up_model import header, made_up_model
from tests.fabrication.driver.made_up_pad import board, untouched

FINGER = FingerPath(
    time_s=np.array([0.0, 3.0, 3.05, 1000.0]),  # late enough for a machine that is busy
    press_mm=np.array([[16.0, 16.0, -5.0]] * 2 + [[10.0, 22.0, 3.0]] * 2),
)


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    config = tmp_path / "driver.toml"
    text = dump_driver_config(preset("piacenza2017-pad"), [1e5] * 8, np.minimum(untouched(), 1023))
    config.write_text(text, encoding="utf-8")
    save_model(tmp_path / "pad.optomodel", made_up_model())
    return str(config), str(tmp_path / "pad.optomodel")


@pytest.mark.slow
def test_read_with_a_model_measures_the_untouched_pad_first_and_then_tells_each_frame(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    config, model = files
    with FakePort(board()) as port:
        command = ["driver", "read", config, "--port", port.name, "--model", model, "--frames", "3"]
        assert main(command) == 0
        assert "untouched" in capsys.readouterr().err
        assert main([*command, "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["touched"] for line in lines] == [False] * 3


@pytest.mark.slow
def test_read_with_a_model_tells_touches_frame_by_frame(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    config, model = files
    with FakePort(board(FINGER)) as port:
        command = ["driver", "read", config, "--port", port.name, "--model", model, "--seconds", "3.2"]
        assert main([*command, "--json"]) == 0
        lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert main(["driver", "read", config, "--port", port.name, "--model", model, "--frames", "3"]) == 0
        assert "untouched" in capsys.readouterr().err
    touched = [line for line in lines if line["touched"]]
    assert not lines[0]["touched"]
    assert len(touched) > 10
    assert touched[-1]["x_mm"] == pytest.approx(10.0, abs=1.0)
    assert touched[-1]["depth_mm"] == pytest.approx(3.0, abs=1.0)
    assert touched[-1]["sigma_mm"] == [None, None, None]


@pytest.mark.parametrize("fault", ["damaged", "version", "design", "parts", "missing"])
def test_a_model_that_does_not_fit_is_refused_before_a_port_is_opened(
    fault: str, files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config, model = files
    told = {
        "damaged": "damaged",
        "version": "has version 2 of the model format",
        "design": "is of design abababab",
        "parts": "its receivers are Q1",
        "missing": "no such file",
    }[fault]
    file = tmp_path / "other.optomodel"
    if fault == "damaged":
        whole = bytearray(Path(model).read_bytes())
        whole[len(whole) // 2] ^= 0xFF
        file.write_bytes(whole)
    elif fault != "missing":
        changes = {
            "version": {"version": 2},
            "design": {"design_digest": "ab" * 32},
            "parts": {"receiver_names": tuple(f"Q{k}" for k in range(1, 9))},
        }[fault]
        save_model(file, replace(made_up_model(), header=header(**changes)))
    assert main(["driver", "read", config, "--port", "nowhere", "--model", str(file)]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert str(file) in said
