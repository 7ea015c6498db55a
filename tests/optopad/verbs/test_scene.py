"""`optopad scene`: what it writes and says."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from optopad.cli import main
from optopad.design.progress import OnStep
from optopad.design.spec import SensorDesign
from optopad.fabrication.bundle import altered_files

PAD = "gripper-stadium"


@pytest.fixture(autouse=True)
def _no_map_of_light(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPTOPAD_CACHE", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    assert main(["scene", PAD, "--out", str(out)]) == 0
    (bundle,) = out.iterdir()
    return bundle


def test_the_bundle_has_the_pad_its_meshes_and_a_demo_scene(folder: Path) -> None:
    assert altered_files(folder) == ()
    names = {path.name for path in (folder / "scene").iterdir()}
    assert names == {"pad.xml", "demo.xml", "pad_mold.stl", "pad_silicone.stl"}
    for name in ("pad.xml", "demo.xml"):
        mujoco.MjModel.from_xml_path(str(folder / "scene" / name))


def test_the_screen_has_mass_error_and_how_to_attach_the_pad(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scene", PAD, "--out", str(folder.parent)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "pad 5.9 g, 299 taxels" in said
    assert (
        "force of a 1.5 mm ball within 1.6% of the contact model from 0.3 to 2 mm, at steps up to 4 ms"
        in said
    )
    assert f"optopad scene {PAD} --fit" in said
    assert "prefix='left_'" in said
    assert said.endswith(str(folder / "scene"))


def test_fit_makes_the_map_of_light_and_says_its_errors(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def fitted(design: SensorDesign, *, seed: int, on_step: OnStep) -> SimpleNamespace:
        asked.append((design.name, seed))
        on_step("states", 1.0)
        return SimpleNamespace(errors={"ball": 0.00241, "all": 0.0093})

    monkeypatch.setattr("optopad.sims.robot.light_fit.fit_fast_light", fitted)
    assert main(["scene", PAD, "--fit", "--seed", "3", "--out", str(folder.parent)]) == 0
    assert asked == [(PAD, 3)]
    assert "rms over the untouched signal: ball 0.24 %, all 0.93 %" in capsys.readouterr().out


def test_json_has_the_contact_parameters_of_the_file(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scene", PAD, "--out", str(folder.parent), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    model = mujoco.MjModel.from_xml_path(found["files"][-2])
    assert found["mass_kg"] == pytest.approx(model.body_mass.sum(), rel=1e-5)
    assert model.geom("pad_top").solimp == pytest.approx(found["contact"]["solimp"])
    assert model.numeric("pad_inverse_weight").data[0] == pytest.approx(
        found["contact"]["inverse_weight_per_kg"]
    )
    assert np.isfinite(found["contact"]["force_error"])


def test_a_design_that_breaks_a_rule_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["scene", PAD, "--out", str(tmp_path / "out"), "--set", "mold.floor_mm=0.1"]) == 2
    assert "mold.floor_mm" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
