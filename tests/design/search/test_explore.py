"""The search itself, on an objective that costs nothing."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import optuna
import pytest

from optopad.design.errors import DesignError, InputError
from optopad.design.search.explore import explore, findings_of, not_dominated, sampler_of
from optopad.design.search.improve import Judged

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def load_cheap():
    spec = importlib.util.spec_from_file_location("cheap_search", HERE / "cheap_search.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


cheap = load_cheap()
bowl, cheap_space, outcome = cheap.bowl, cheap.cheap_space, cheap.outcome


def url_in(folder: Path) -> str:
    return f"sqlite:///{folder / 'study.db'}"


HAS_TORCH = importlib.util.find_spec("torch") is not None
GP = pytest.param("gp", marks=pytest.mark.skipif(not HAS_TORCH, reason="torch is not installed"))


OTHERS = [pytest.param(name, marks=pytest.mark.slow) for name in ("nsga2", "qmc")]
RANDOM = pytest.param("random", marks=pytest.mark.slow)


@pytest.fixture(scope="module")
def whole_of(tmp_path_factory):
    """A search of 14 trials by a sampler, without a stop; made once."""

    @cache
    def whole(sampler: str = "tpe"):
        return explore(cheap_space(sampler), bowl, url_in(tmp_path_factory.mktemp(sampler)), trials=14)

    return whole


@pytest.mark.parametrize("sampler", ["tpe", *OTHERS, RANDOM, GP])
def test_the_same_seed_gives_the_same_designs(sampler, tmp_path, whole_of):
    again = explore(cheap_space(sampler), bowl, url_in(tmp_path), trials=14)
    assert len(again.tried) == 14
    assert outcome(again) == outcome(whole_of(sampler))


def two(folder: Path) -> tuple[Path, Path]:
    (folder / "a").mkdir()
    (folder / "b").mkdir()
    return folder / "a", folder / "b"


@pytest.mark.parametrize("sampler", ["tpe", *OTHERS, GP])
def test_stopping_and_going_on_changes_nothing(sampler, tmp_path, whole_of):
    whole = whole_of(sampler)
    for trials in (3, 6, 14):
        parts = explore(cheap_space(sampler), bowl, url_in(tmp_path), trials=trials)
    # 3 and 6 are no multiples of the batch: sizes of batches differ there, and with them what a sampler knew
    assert len(parts.tried) == len(whole.tried) == 14
    assert outcome(parts)[:3] == outcome(whole)[:3]


def test_an_objective_that_breaks_loses_nothing_and_is_asked_again(tmp_path, whole_of):
    calls = []

    def breaks(design, limits):
        calls.append(design.digest)
        if len(calls) == 8:
            raise RuntimeError("power cut")
        return bowl(design, limits)

    with pytest.raises(RuntimeError, match="power cut"):
        explore(cheap_space(), breaks, url_in(tmp_path), trials=14)
    resumed = explore(cheap_space(), bowl, url_in(tmp_path), trials=14)
    assert outcome(resumed) == outcome(whole_of())


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["tpe", *OTHERS])
def test_designs_that_died_change_neither_the_others_nor_their_numbers(
    sampler, tmp_path, whole_of, monkeypatch
):
    """A killed process leaves its designs marked as running, here three of a batch of four, twice."""
    calls = []

    def dies(design, limits):
        calls.append(design.digest)
        if len(calls) in (7, 9):
            raise RuntimeError("killed")
        return bowl(design, limits)

    with monkeypatch.context() as patch:
        patch.setattr("optopad.design.search.explore.release", lambda *_: None)
        with pytest.raises(RuntimeError, match="killed"):
            explore(cheap_space(sampler), dies, url_in(tmp_path), trials=14)
    with pytest.raises(RuntimeError, match="killed"):
        explore(cheap_space(sampler), dies, url_in(tmp_path), trials=14)
    resumed = explore(cheap_space(sampler), bowl, url_in(tmp_path), trials=14)
    assert [one.number for one in resumed.tried] == list(range(14))
    assert outcome(resumed) == outcome(whole_of(sampler))
    assert [one.number for one in resumed.front] == [one.number for one in whole_of(sampler).front]


SEARCH = """
import json, sys
from optopad.design.search.explore import explore
from optopad.design.search.explore import importances
from tests.design.search.cheap_search import bowl, cheap_space
found = explore(cheap_space(), bowl, sys.argv[1], trials=26)
tried = [(one.number, list(one.parameters.items()), list(one.judged.figures.items())) for one in found.tried]
print(json.dumps([tried, [one.number for one in found.front], importances(cheap_space(), sys.argv[1])]))
"""


@pytest.mark.full
def test_a_search_does_not_depend_on_the_seed_of_pythons_hashes(tmp_path):
    said = []
    for seed in ("1", "2"):
        url = f"sqlite:///{tmp_path / seed}.db"
        here = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONHASHSEED": seed}
        run = subprocess.run([sys.executable, "-c", SEARCH, url], env=here, capture_output=True, check=True)
        said.append(run.stdout)
    assert said[0] == said[1]
    assert b"evenness" in said[0]


def test_an_interrupt_ends_with_what_was_found(tmp_path):
    def interrupts(design, limits):
        if len(done) == 6:
            raise KeyboardInterrupt
        done.append(design.digest)
        return bowl(design, limits)

    done = []
    found = explore(cheap_space(), interrupts, url_in(tmp_path), trials=14)
    assert found.is_interrupted
    assert len(found.tried) == len(done) - 1  # the base design is judged first, and is no trial yet
    assert len(explore(cheap_space(), bowl, url_in(tmp_path), trials=8).tried) == 8


@pytest.mark.slow
def test_kill_minus_nine_loses_nothing(tmp_path):
    first, second = two(tmp_path)
    whole = explore(cheap_space(), bowl, url_in(first), trials=22)
    command = [sys.executable, str(HERE / "cheap_search.py"), url_in(second), "22", "tpe", "alone", "0.1"]
    judged = 0
    for least in (3, 9, 14):
        judged = killed_after(command, least)
        left = findings_of(cheap_space(), url_in(second), wanted=22)
        assert len(left.tried) >= judged
    resumed = explore(cheap_space(), bowl, url_in(second), trials=22)
    assert outcome(resumed) == outcome(whole)


def killed_after(command: list[str], least: int) -> int:
    """Kill a search once it has judged a number of designs; how many it said it had."""
    here = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, env=here, stdout=subprocess.PIPE, text=True)
    judged = 0
    for line in process.stdout:
        judged = int(line)
        if judged >= least:
            process.send_signal(signal.SIGKILL)
            break
    process.wait()
    process.stdout.close()
    assert process.returncode == -signal.SIGKILL
    return judged


def test_the_base_design_is_tried_first(tmp_path):
    found = explore(cheap_space(), bowl, url_in(tmp_path), trials=1)
    assert found.tried[0].parameters["cavity.clear_thickness_mm"] == 8.0
    assert found.base.figures["evenness"] == found.tried[0].judged.figures["evenness"]


def test_a_grid_tries_every_point_once(tmp_path):
    space = cheap_space(
        "grid", fields=[{"path": "cavity.clear_thickness_mm", "low": 6, "high": 10, "step": 0.5}]
    )
    found = explore(space, bowl, url_in(tmp_path), trials=100)
    tried = sorted(one.parameters["cavity.clear_thickness_mm"] for one in found.tried)
    assert tried == [6.0, 6.5, 7.0, 7.5, 8.0, 8.5, 9.0, 9.5, 10.0]
    assert found.wanted == 9


@pytest.mark.slow
def test_tpe_finds_a_better_design_than_the_base(tmp_path):
    found = explore(cheap_space(), bowl, url_in(tmp_path), trials=40)
    best = max(one.judged.figures["evenness"] for one in found.front)
    assert best >= 0.8  # the best of the space is 1, each of its neighbours 0.8; the base has 0.44
    assert all(one.judged.figures["strength"] >= 0.5 for one in found.front)


@pytest.mark.slow
def test_the_front_is_that_of_optuna(tmp_path):
    found = explore(cheap_space(constraints=[]), bowl, url_in(tmp_path), trials=20)
    study = optuna.load_study(study_name="cheap", storage=url_in(tmp_path))
    ours = {one.digest for one in found.front}
    assert ours == {trial.user_attrs["judged"]["digest"] for trial in study.best_trials}


def test_a_point_equal_to_another_is_not_dominated_by_it():
    losses = np.array([[1.0, 2.0], [1.0, 2.0], [2.0, 1.0], [2.0, 2.0]])
    assert not_dominated(losses).tolist() == [True, True, True, False]


def test_a_design_that_stops_early_says_why_and_is_not_on_the_front(tmp_path):
    found = explore(cheap_space("random"), bowl, url_in(tmp_path), trials=30)
    stopped = [one for one in found.tried if one.judged.reason]
    assert stopped
    assert {one.judged.reason for one in stopped} == {"too thick to be judged"}
    assert not {one.number for one in stopped} & {one.number for one in found.front}


def test_a_figure_that_is_not_resolved_is_no_value_to_win_with(tmp_path):
    def blind(design, limits):
        return Judged(figures={"evenness": None, "pad_height_mm": 1.0, "strength": 1.0}, verdict="CONTIGUOUS")

    found = explore(cheap_space(), blind, url_in(tmp_path), trials=4)
    assert found.front == ()
    assert {one.judged.reason for one in found.tried} == {"evenness: not resolved"}


def test_a_multiple_of_a_figure_that_the_base_lacks_is_refused(tmp_path):
    def nothing(design, limits):
        return Judged(reason="outside the model")

    with pytest.raises(DesignError, match="strength: the base"):
        explore(cheap_space(), nothing, url_in(tmp_path), trials=4)


def test_a_study_of_another_space_is_refused_and_kept(tmp_path):
    explore(cheap_space(), bowl, url_in(tmp_path), trials=4)
    other = cheap_space(objectives=[{"figure": "evenness"}, {"figure": "strength"}])
    with pytest.raises(InputError, match="'cheap'"):
        explore(other, bowl, url_in(tmp_path), trials=8)
    assert len(findings_of(cheap_space(), url_in(tmp_path), wanted=4).tried) == 4


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("postgresql://someone:secret@127.0.0.1:9/none", "127.0.0.1:9/none cannot be reached"),
        ("sqlite:////no/such/folder/study.db", "open database file"),
        ("oracl://x", "cannot be reached"),
        ("nonsense", "cannot be reached"),
    ],
)
def test_a_storage_out_of_reach_is_said_in_one_line_without_its_password(url, words):
    with pytest.raises(InputError, match=words) as caught:
        explore(cheap_space(), bowl, url, trials=1)
    assert "secret" not in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_that_is_no_database_is_refused_and_left_alone(tmp_path):
    (tmp_path / "study.db").write_text("my diary, " * 200)
    with pytest.raises(InputError, match="not a database"):
        explore(cheap_space(), bowl, url_in(tmp_path), trials=1)
    assert (tmp_path / "study.db").read_text().startswith("my diary")


@pytest.mark.skipif(HAS_TORCH, reason="torch is installed here")
def test_the_gp_sampler_names_the_package_it_lacks(tmp_path):
    with pytest.raises(InputError, match='"gp" needs the package torch'):
        explore(cheap_space("gp"), bowl, url_in(tmp_path), trials=1)


def test_a_grid_without_steps_and_one_too_large_are_refused(tmp_path):
    free = {"path": "cavity.clear_thickness_mm", "low": 6.0, "high": 12.0}
    with pytest.raises(DesignError, match="grid sampler"):
        cheap_space("grid", fields=[free])
    fine = [
        free | {"step": 0.001},
        {"path": "emitters.height_mm", "low": 3.0, "high": 6.0, "step": 0.01},
    ]
    with pytest.raises(DesignError, match="the grid has 1806301 points"):
        explore(cheap_space("grid", fields=fine), bowl, url_in(tmp_path), trials=1)


def test_proposals_at_the_same_place_are_seeded_alike_and_workers_apart():
    space = cheap_space("random")
    draws = [sampler_of(space, *at)._rng.rng.random() for at in ((5, ""), (5, ""), (6, ""), (5, "other"))]
    assert draws[0] == draws[1]
    assert len(set(draws)) == 3
