"""The verb calibrate: what it refuses, what it writes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from optopad.cli import main
from optopad.design.io import load_design
from optopad.design.preset import preset
from optopad.screen.training import CalibratedBuild
from optopad.sims.learning.calibration import Calibration, Fitted, report_of
from optopad.sims.learning.calibration_problem import calibration_samples, unknowns_of, with_values
from optopad.sims.learning.inference.model_file import load_model
from optopad.sims.readings.dataset import save_data
from optopad.verbs.calibrate import write_calibration
from tests.sims.learning.made_up_map import made_up_map_model, ratios, untouched_counts
from tests.sims.learning.made_up_presses import made_up_data

PAD = "piacenza2017-pad"


def recording(presses: int):
    data, _ = made_up_data(
        lambda at: ratios(at) * untouched_counts() * 1e-5, presses, 1, np.zeros(presses), full_scale=1023.0
    )
    return replace(data, design_digest=preset(PAD).digest)


def made_up_build(share_left: float) -> CalibratedBuild:
    design, data = preset(PAD), recording(30)
    unknowns = unknowns_of(design)
    values = np.array([(one.value - one.middle) / one.spread for one in unknowns])
    values[2] = (5.1 - unknowns[2].middle) / unknowns[2].spread
    found = Calibration(
        design=with_values(
            design,
            unknowns,
            np.array([one.middle + one.spread * u for one, u in zip(unknowns, values, strict=True)]),
        ),
        unknowns=unknowns,
        fitted=Fitted(
            values=values,
            covariance=share_left**2 * np.eye(len(unknowns)),
            gains=np.full(64, 6e4),
            gain_spread=np.full(64, 0.01),
            offset_mm=np.tile([0.0, 0.0, 0.05], (30, 1)),
            rms=(9.0, 1.1),
            traces=45,
        ),
        samples=calibration_samples(data, 5.0),
        seed=0,
    )
    return CalibratedBuild(
        design=preset(PAD),
        calibration=found,
        report=report_of(found),
        model=made_up_map_model(),
        notes=("4 channels clip",),
    )


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["calibrate", *arguments]) == 2
    return capsys.readouterr().err


def test_a_recording_of_another_design_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file = save_data(recording(6), tmp_path / "presses.nc")
    said = refused(capsys, PAD, str(file), "--set", "emitters.height_mm=5.1")
    assert "of design" in said
    assert not list(tmp_path.glob("*calibration*"))


def test_too_few_presses_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file = save_data(recording(3), tmp_path / "presses.nc")
    assert "3 presses" in refused(capsys, PAD, str(file))


def test_no_recording_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert "no such file" in refused(capsys, PAD, str(tmp_path / "none.nc"))


def test_a_design_without_open_optics_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    design = preset(PAD)
    exact = design.with_(tolerances={one.path: 0.0 for one in unknowns_of(design)})
    data = replace(recording(6), design_digest=None)
    file = save_data(data, tmp_path / "presses.nc")
    from optopad.design.io import save_design

    save_design(exact, tmp_path / "exact.toml")
    assert "all optical values" in refused(capsys, str(tmp_path / "exact.toml"), str(file))


def test_the_twin_the_facts_and_the_model_are_written(tmp_path: Path):
    made, design = made_up_build(0.1), preset(PAD)
    twin, facts, model = write_calibration(made, tmp_path / "out")
    assert load_design(twin).emitters.height_mm == pytest.approx(5.1)
    document = json.loads(facts.read_text(encoding="utf-8"))
    assert document["digest"] == design.digest
    assert document["calibrated_digest"] == load_design(twin).digest
    assert document["presses"] == 30
    assert np.shape(document["gains_counts_per_flux"]) == (8, 8)
    assert document["undetermined"] == []
    assert load_model(model).header.kind == "signal-map"


def test_an_interrupted_calibration_leaves_the_earlier_one_as_it_was(tmp_path: Path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    write_calibration(made_up_build(0.1), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr("optopad.verbs.calibrate.save_model", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_calibration(made_up_build(0.2), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
