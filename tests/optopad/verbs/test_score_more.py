"""Figures that a score computes only if asked, of objects, sideways load and two touches: written, or refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from optopad.cli.main import main
from optopad.design.errors import InputError
from optopad.design.pad import Pad
from optopad.design.preset import preset
from optopad.design.progress import silent
from optopad.verbs.score import MORE, _added

PAD = Pad.of(preset("piacenza2017-pair"))
JUDGED = SimpleNamespace(readout="one")


def test_figures_are_written_for_the_report_and_a_refusal_is_not(tmp_path: Path):
    (tmp_path / "sims").mkdir()
    found = SimpleNamespace(to_json=lambda: {"pull_n": [0.5]})
    for one in MORE:
        asked: list[object] = []
        fine = replace(
            one, score=lambda pad, *, seed, on_step, asked=asked: asked.append((pad, seed)) or found
        )
        assert _added(fine, PAD, tmp_path, JUDGED, 3, silent) == {"pull_n": [0.5]}
        assert asked == [(PAD, 3)]
        file = tmp_path / "sims" / one.file
        assert json.loads(file.read_text(encoding="utf-8")) == {"pull_n": [0.5]}
        file.unlink()

        def refuse(*_: object, **__: object) -> None:
            raise InputError("training data: too few pairs")

        refused = _added(replace(one, score=refuse), PAD, tmp_path, JUDGED, 0, silent)
        assert one.lines(refused) == [f"{one.name:<12}not computed: training data: too few pairs"]
        assert (
            "no verdict" in _added(fine, PAD, tmp_path, SimpleNamespace(readout=None), 0, silent)["refused"]
        )
        assert not file.exists()


@pytest.mark.parametrize("flag", [["--objects"], ["--shear"], ["--touches", "2"]])
def test_smooth_walls_are_refused_before_any_work(
    flag: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    smooth = ["--set", "surfaces.wall_finish=glossy"]
    assert main(["score", "piacenza2017-pair", *flag, *smooth, "--out", str(tmp_path)]) == 2
    assert "surfaces.wall_finish = 'diffuse'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("touches", [0, 3])
def test_more_than_two_touches_are_refused_before_any_work(
    touches: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["score", "piacenza2017-pair", "--touches", str(touches), "--out", str(tmp_path)]) == 2
    assert f"touches: {touches} is refused; the models know one or two" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
