"""``score --tolerance``: builds in score.json and figure, kept when interrupted; the real models on few builds."""

import json
from dataclasses import replace

import pytest

from optopad.cli import main
from optopad.design.preset import preset
from optopad.sims.score import build_tolerance
from optopad.sims.verdict import builds
from tests.sims.made_up_scores import contiguous_score

pytestmark = pytest.mark.slow
COMMAND = ["score", "fast.toml", "--tolerance", "--builds", "10", "--json"]


@pytest.fixture
def few_values(tmp_path, monkeypatch):
    """The pair with two values open: all others measured."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "fast.toml", "--preset", "piacenza2017-pair"]) == 0
    text = (tmp_path / "fast.toml").read_text(encoding="utf-8")
    zero = {
        "surfaces.wall_reflectance",
        "surfaces.bottom_reflectance",
        "cavity.black_thickness_mm",
        "cavity.length_mm",
        "cavity.width_mm",
        "indenter.tip_radius_mm",
        "elastomer.refractive_index",
        "elastomer.absorption_db_per_cm",
        *(f"part_measurements.sunled-xscwd23mb.{name}" for name in ("active_width_mm", "half_angle_deg")),
        *(f"part_measurements.sunled-xscwd23mb.{name}" for name in ("active_height_mm",)),
        "emitters.height_mm",
    }
    given = "[tolerances]\n" + "\n".join(f'"{path}" = 0' for path in sorted(zero))
    (tmp_path / "fast.toml").write_text(f"{text}\n{given}\n", encoding="utf-8")
    return tmp_path


@pytest.mark.full
def test_an_interrupted_study_goes_on_where_it_stopped(few_values, monkeypatch, capsys):
    asked = []
    real = builds.facing_brief
    scored = replace(contiguous_score(preset("piacenza2017-pair")), pad_signals=None)
    monkeypatch.setattr(
        "optopad.sims.score.scoring.score", lambda *_, **__: scored
    )  # the builds are what is tested here

    def judge(draft, *, seed):
        asked.append(draft.design.digest)
        if len(asked) == 7:
            raise KeyboardInterrupt
        return real(draft, seed=seed)

    monkeypatch.setattr("optopad.sims.verdict.builds.facing_brief", judge)
    assert main(COMMAND) == 130
    capsys.readouterr()
    assert main(COMMAND) == 0
    document = json.loads(capsys.readouterr().out)
    assert len(asked) == len(set(asked)) + 1  # only the build that was interrupted was begun twice
    study = document["builds"]
    assert study["builds"] == 10
    assert {row["path"] for row in study["values"]} == {"receivers.height_mm", "cavity.clear_thickness_mm"}
    assert study["kept_share_95"][0] <= study["kept_share"] <= study["kept_share_95"][1]
    bundle = next(few_values.glob("outputs/fast-*"))
    assert {"builds.svg", "builds.png", "score.json"} <= {path.name for path in (bundle / "sims").iterdir()}
    assert not list(few_values.glob("outputs/.fast*"))
    rows = {row["path"] for row in document["tolerance"]["rows"]}
    assert "cavity.clear_thickness_mm" in rows
    assert build_tolerance.DEFAULT_BUILDS == 200
