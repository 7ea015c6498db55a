"""The work behind the page: answers in order, stale work given up, a press served at once, the score's own bits."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from optopad.design.held_object import held_of
from optopad.design.preset import preset
from optopad.design.spec import SensorDesign
from optopad.sims.score import objective as draft
from optopad.sims.score.objective import curves_under, draft_score
from optopad.sims.score.result import ContinuityScore
from optopad.sims.score.scoring import score
from optopad.studio.session import LivePress
from optopad.studio.workshop import (
    Curves,
    Failed,
    LiveVerdict,
    Look,
    Progress,
    Rays,
    Readings,
    Request,
    Result,
    Workshop,
    asked_press,
)

PAIR = preset("piacenza2017-pair")
PRESS = LivePress(x_mm=9.0, y_mm=11.0, depth_mm=2.0)
CLEAR = "cavity.clear_thickness_mm"
PATIENCE_S = 120.0


class Answers:
    """What a workshop posts, and waiting for it."""

    def __init__(self) -> None:
        self.all: list[Result] = []
        self.threads: set[str] = set()
        self._changed = threading.Condition()
        self.on_each: Callable[[Result], None] = lambda _answer: None

    def put(self, answer: Result) -> None:
        self.on_each(answer)
        with self._changed:
            self.all.append(answer)
            self.threads.add(threading.current_thread().name)
            self._changed.notify_all()

    def wait(self, is_it: Callable[[Result], bool], after: int = 0, seconds: float = PATIENCE_S) -> int:
        """The number of the first such answer."""

        def found() -> int | None:
            return next((n for n, one in enumerate(self.all) if n >= after and is_it(one)), None)

        with self._changed:
            assert self._changed.wait_for(lambda: found() is not None, seconds), self.names()
            number = found()
        assert number is not None
        return number

    def wait_idle(self, after: int = 0) -> int:
        return self.wait(lambda one: isinstance(one, Progress) and not one.stage, after)

    def of(self, kind: type) -> list[Any]:
        return [one for one in self.all if isinstance(one, kind)]

    def names(self) -> list[str]:
        """Kinds of the answers, verdicts by their level, without word of progress."""
        told = [one for one in self.all if not isinstance(one, Progress)]
        return [one.level if isinstance(one, LiveVerdict) else type(one).__name__ for one in told]


@contextmanager
def working(request: Request | None = None, seed: int = 0) -> Iterator[tuple[Workshop, Answers]]:
    answers = Answers()
    shop = Workshop(answers.put, seed=seed)
    shop.want(request)
    shop.start()
    try:
        yield shop, answers
    finally:
        began = time.monotonic()
        shop.close()
        assert time.monotonic() - began < 2.0
        assert not shop._thread.is_alive()


def request_of(design: SensorDesign = PAIR, press: LivePress = PRESS, **options: bool) -> Request:
    return Request(design=design, press=press, **({"is_thorough": False} | options))


def is_level(level: str) -> Callable[[Result], bool]:
    return lambda one: isinstance(one, LiveVerdict) and one.level == level


@pytest.fixture(scope="module")
def pair_draft() -> ContinuityScore:
    return draft_score(PAIR)


@pytest.fixture(autouse=True, scope="module")
def _kept_answers() -> Iterator[None]:
    """Curves and drafts that a workshop of this file had are not traced again; its own steps are told all the same."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("curves_under", "draft_score", "with_draft_bounds"):
            patch.setattr(draft, name, kept(getattr(draft, name)))
        yield


def kept(work: Callable[..., Any]) -> Callable[..., Any]:
    found: dict[tuple[Any, ...], Any] = {}

    def once(design: SensorDesign, *given: Any, on_step: Any = None, **options: Any) -> Any:
        of = [one.digest if isinstance(one, ContinuityScore) else one for one in given]
        key = (design.digest, *of, *sorted(options.items()))
        if key not in found:
            found[key] = work(design, *given, on_step=on_step, **options)
        elif on_step is not None:
            on_step("kept", 1.0)
        return found[key]

    return once


@pytest.fixture
def slow_score(monkeypatch: pytest.MonkeyPatch, pair_draft: ContinuityScore) -> dict[str, Any]:
    """A score that does nothing but tell its progress for up to a minute, to be looked into while it lasts."""
    state: dict[str, Any] = {"steps": 0, "begun": 0, "ended": 0}

    def stand_in(design: SensorDesign, *, on_step: Callable[[str, float], None], **_: Any) -> Any:
        state["begun"] += 1
        try:
            for number in range(6000):
                on_step("map", number / 6000)
                state["steps"] += 1
                if state.get("enough"):
                    break
                time.sleep(0.01)
        finally:
            state["ended"] += 1
        return draft_score(design) if state.get("is_out") else replace(pair_draft, digest=design.digest)

    monkeypatch.setattr("optopad.sims.score.scoring.score", stand_in)
    monkeypatch.setattr(
        "optopad.sims.score.build_tolerance.with_tolerance", lambda _design, found, **_: found
    )
    monkeypatch.setattr("optopad.sims.score.field_steps.with_field_steps", lambda _design, found, **_: found)
    monkeypatch.setattr("optopad.sims.score.trials.with_trial", lambda _design, found, **_: found)
    return state


def test_answers_come_in_order_and_are_of_the_wish(slow_score: dict[str, Any]) -> None:
    slow_score["enough"] = True
    with working(request_of(is_thorough=True)) as (shop, answers):
        answers.wait_idle(answers.wait(lambda one: isinstance(one, Curves) and not one.found.is_draft))
        assert answers.names() == ["Curves", "Look", "draft", "score", "whole", "Curves"]
        assert {one.digest for one in answers.all if not isinstance(one, Progress)} == {PAIR.digest}
        assert [one.found.is_draft for one in answers.of(Curves)] == [True, False]
        (look,) = answers.of(Look)
        assert look.press == PRESS
        assert look.points_mm[:, 2].min() == pytest.approx(8.0 - 2.0)
        assert look.force_n > 0.0
        assert answers.threads == {"studio-workshop"}
        assert shop.running_jobs == 0


def test_answers_are_those_of_the_physics_asked_directly() -> None:
    with working(request_of(), seed=5) as (_, answers):
        answers.wait_idle(answers.wait(is_level("draft")))
        (found,), (judged,) = answers.of(Curves), answers.of(LiveVerdict)
    true = curves_under(PAIR, PRESS.place_mm, seed=5)
    assert [pair.name for pair in found.found.pairs] == [pair.name for pair in true.pairs]
    for here, there in zip(found.found.pairs, true.pairs, strict=True):
        assert np.array_equal(here.curves.total, there.curves.total)
    assert judged.score.to_json() == draft_score(PAIR, seed=5).to_json()


def test_after_many_quick_wishes_only_the_last_design_is_judged(slow_score: dict[str, Any]) -> None:
    slow_score["enough"] = True
    designs = [PAIR.with_(**{CLEAR: 8.05 + 0.05 * k}) for k in range(20)]
    running: list[int] = []
    with working() as (shop, answers):
        answers.on_each = lambda _answer: running.append(shop.running_jobs)
        for design in designs:
            shop.want(request_of(design, is_thorough=True))
            time.sleep(0.01)
        answers.wait(is_level("whole"))
    assert {one.digest for one in answers.of(LiveVerdict) if one.level != "draft"} == {designs[-1].digest}
    assert {one.digest for one in answers.of(LiveVerdict)} == {designs[-1].digest}
    assert slow_score["begun"] == slow_score["ended"] == 1
    assert max(running) == 1
    assert answers.of(Failed) == []


@pytest.mark.parametrize("other", [None, request_of()], ids=["no request", "drafts alone"])
def test_a_score_that_is_not_wanted_any_more_is_given_up(
    slow_score: dict[str, Any], other: Request | None
) -> None:
    with working(request_of(is_thorough=True)) as (shop, answers):
        answers.wait(
            lambda one: isinstance(one, Progress) and one.stage == "map", answers.wait(is_level("draft"))
        )
        shop.want(other)
        answers.wait_idle(len(answers.all))
        assert slow_score["begun"] == slow_score["ended"] == 1
        slow_score["enough"] = True
        shop.want(request_of(is_thorough=True))
        answers.wait(is_level("whole"))
        assert answers.names().count("draft") == 1


def test_a_new_press_is_served_while_a_score_is_under_way(slow_score: dict[str, Any]) -> None:
    with working(request_of(is_thorough=True)) as (shop, answers):
        answers.wait(
            lambda one: isinstance(one, Progress) and one.stage == "map", answers.wait(is_level("draft"))
        )
        for x_mm in (10.0, 11.0):
            before = len(answers.all)
            press = LivePress(x_mm=x_mm, y_mm=9.0, depth_mm=2.5)
            shop.want(request_of(press=press, is_thorough=True))
            look = answers.wait(lambda one: isinstance(one, Look), before)
            assert answers.all[look].press == press  # type: ignore[union-attr]
            assert answers.of(Curves)[-1].found.place_mm == press.place_mm
        assert (slow_score["begun"], slow_score["ended"]) == (1, 0)
        slow_score["enough"] = True
        answers.wait(lambda one: isinstance(one, Curves) and not one.found.is_draft)
        assert slow_score["begun"] == 1
        assert answers.names() == [
            "Curves",
            "Look",
            "draft",
            *["Curves", "Look"] * 2,
            "score",
            "whole",
            "Curves",
        ]
        assert answers.of(Curves)[-1].found.place_mm == (11.0, 9.0)


def test_rays_and_readings_come_after_the_look_and_of_the_press() -> None:
    with working(request_of(with_rays=True, with_readings=True)) as (_, answers):
        answers.wait(is_level("draft"))
        assert answers.names() == ["Curves", "Look", "Rays", "Readings", "draft"]
        (rays,), (readings,) = answers.of(Rays), answers.of(Readings)
    assert rays.press == readings.press == PRESS
    assert len(rays.rays) >= 8
    for ray in rays.rays:
        assert ray.pair in {f"E{i}-R{j}" for i in (1, 2, 3) for j in (1, 2, 3)}
        assert ray.places_mm.shape[1] == 3
        assert len(ray.places_mm) >= 2
    assert readings.untouched.shape == readings.pressed.shape == (3, 3)
    assert readings.untouched.diagonal() == pytest.approx(800.0, rel=0.1)
    (found,) = answers.of(Curves)
    assert [pair.name for pair in found.found.pairs] == ["E2-R2"]
    middle = found.found.pairs[0].curves
    left = np.interp(PRESS.depth_mm, middle.depth_mm, middle.total) / middle.total[0]
    share = readings.pressed[1, 1] / readings.untouched[1, 1]
    assert share == pytest.approx(left, abs=0.02)  # by the pad's own walls, and without them


def test_a_design_outside_the_models_is_said_with_the_reason_and_the_work_goes_on(
    slow_score: dict[str, Any],
) -> None:
    outside = PAIR.with_(**{"operating.max_depth_mm": 0.2})
    slow_score["enough"] = slow_score["is_out"] = True
    with working(request_of(outside, is_thorough=True)) as (shop, answers):
        answers.wait(is_level("whole"))
        answers.wait_idle(len(answers.all) - 1)
        (failed,) = answers.of(Failed)
        assert "deadband's least length" in failed.text
        assert failed.digest == outside.digest
        assert {one.score.verdict for one in answers.of(LiveVerdict)} == {"OUT_OF_MODEL_SCOPE"}
        assert {one.score.reason for one in answers.of(LiveVerdict)} == {failed.text}
        assert isinstance([one for one in answers.all if not isinstance(one, Progress)][-1], LiveVerdict)
        end = len(answers.all)
        shop.want(request_of())
        answers.wait(lambda one: isinstance(one, LiveVerdict) and one.score.verdict == "CONTIGUOUS", end)


def test_a_press_that_the_models_do_not_cover_leaves_the_design_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from optopad.design.errors import ModelScopeError

    def refuse(*_: Any, **__: Any) -> Any:
        raise ModelScopeError("too near the wall")

    with working() as (shop, answers):
        monkeypatch.setattr("optopad.studio.pad_mesh.pressed_top", refuse)
        shop.want(request_of(with_rays=True))
        answers.wait_idle(answers.wait(is_level("draft")))
        assert answers.names() == ["Curves", "Failed", "draft"]
        monkeypatch.undo()
        end = len(answers.all)
        shop.want(request_of(press=LivePress(x_mm=10.0, y_mm=10.0, depth_mm=1.0)))
        answers.wait(lambda one: isinstance(one, Look), end)


def test_a_fault_of_ours_is_said_and_the_rest_of_the_work_is_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr("optopad.sims.score.objective.draft_score", fail)
    with working(request_of()) as (_, answers):
        answers.wait_idle(answers.wait(lambda one: isinstance(one, Failed)))
        assert answers.names() == ["Curves", "Look", "Failed"]
        assert answers.of(Failed)[0].text == (
            "optopad's own failure (ZeroDivisionError: of ours); please report it"
        )
    assert "ZeroDivisionError: of ours" in capsys.readouterr().err


def test_closing_ends_a_score_within_two_seconds_and_twice_is_once(slow_score: dict[str, Any]) -> None:
    with working(request_of(is_thorough=True)) as (shop, answers):
        answers.wait(
            lambda one: isinstance(one, Progress) and one.stage == "map", answers.wait(is_level("draft"))
        )
        began = time.monotonic()
        shop.close()
        assert time.monotonic() - began < 2.0
        assert slow_score["begun"] == slow_score["ended"] == 1
        shop.close()
    Workshop(answers.put).close()  # one that never began


@pytest.mark.slow
def test_closing_in_the_middle_of_light_takes_less_than_two_seconds() -> None:
    with working(request_of(preset("piacenza2017-pad"))) as (_, answers):
        answers.wait(
            lambda one: isinstance(one, Progress) and one.stage == "map"
        )  # `working` closes and looks


@pytest.mark.full
@pytest.mark.usefixtures("no_kept_light")
def test_the_score_has_the_bits_of_a_score_without_a_studio_although_presses_were_served_meanwhile() -> None:
    true = score(PAIR, seed=3)
    served: list[str] = []
    with working(request_of(is_thorough=True), seed=3) as (shop, answers):
        end = answers.wait(is_level("draft"))
        for x_mm in (8.0, 11.0):
            time.sleep(2.0)
            end = len(answers.all)
            shop.want(request_of(press=LivePress(x_mm=x_mm, y_mm=10.0, depth_mm=2.0), is_thorough=True))
            look = answers.wait(lambda one: isinstance(one, Look), end)
            served.append(type(answers.all[look]).__name__)
            assert not any(isinstance(one, LiveVerdict) and one.level != "draft" for one in answers.all)
        whole = answers.all[answers.wait(is_level("whole"), seconds=600.0)]
        middle = answers.all[answers.wait(is_level("score"))]
    assert isinstance(whole, LiveVerdict)
    assert isinstance(middle, LiveVerdict)
    assert len(served) == 2
    assert whole.score.to_json() == true.to_json()
    told, whole_told = middle.score.to_json(), true.to_json()
    assert {key for key in told if told[key] != whole_told[key]} <= {
        "tolerance",
        "trial",
        "what_matters",
        "warnings",
    }


def test_an_untouched_pad_is_flat_and_bears_nothing() -> None:
    with working(request_of(press=LivePress(x_mm=9.0, y_mm=11.0, depth_mm=0.0))) as (_, answers):
        answers.wait(lambda one: isinstance(one, Look))
        (look,) = answers.of(Look)
        assert (look.force_n, look.area_mm2) == (0.0, 0.0)
        assert (look.points_mm[:, 2] == 8.0).all()


def test_a_newer_design_ends_a_score_that_is_under_way(slow_score: dict[str, Any]) -> None:
    newer = PAIR.with_(**{CLEAR: 9.0})
    with working(request_of(is_thorough=True)) as (shop, answers):
        answers.wait(is_level("draft"))
        answers.wait(lambda one: isinstance(one, Progress) and one.stage == "map")
        began = time.monotonic()
        shop.want(request_of(newer, is_thorough=False))
        answers.wait(lambda one: isinstance(one, Curves) and one.digest == newer.digest)
        assert time.monotonic() - began < 5.0
        assert (slow_score["begun"], slow_score["ended"]) == (1, 1)
        assert slow_score["steps"] < 6000
        answers.wait(lambda one: isinstance(one, LiveVerdict) and one.digest == newer.digest)
        assert {one.digest for one in answers.of(LiveVerdict) if one.level != "draft"} == set()


def test_an_object_is_dragged_and_turned_and_the_tip_s_answers_are_as_before() -> None:
    cylinder = replace(PRESS, depth_mm=1.5, held=held_of("cylinder,radius=5"))
    presses = [
        PRESS,
        cylinder,
        replace(cylinder, x_mm=11.0),
        replace(cylinder, held=held_of("cylinder,radius=5,yaw=40")),
        PRESS,
    ]
    looks, seen = [], []
    with working() as (shop, answers):
        for press in presses:
            before = len(answers.all)
            shop.want(request_of(press=press, with_rays=True))
            looks.append(answers.all[answers.wait(lambda one: isinstance(one, Look), before)])
            if press.held is not None:
                found = answers.all[answers.wait(lambda one: isinstance(one, Readings), before)]
                assert isinstance(found, Readings)
                assert found.press == press
                assert found.changes is not None
                assert (np.abs(found.changes) > 3.0).any()
                seen.append(found.pressed)
    first, pressed, *_, last = looks
    assert isinstance(first, Look)
    assert isinstance(pressed, Look)
    assert isinstance(last, Look)
    assert pressed.points_mm[:, 2].min() == pytest.approx(8.0 - 1.5, abs=0.01)
    assert pressed.force_n > 0.0 < pressed.area_mm2
    for one, other in ((0, 1), (0, 2), (1, 2)):
        assert np.abs(seen[one] - seen[other]).max() > 10.0
    assert np.array_equal(first.points_mm, last.points_mm)
    assert (first.force_n, first.area_mm2) == (last.force_n, last.area_mm2)


def test_an_object_that_is_pressed_too_deep_is_refused_with_the_way_out() -> None:
    too_deep = replace(PRESS, depth_mm=5.0, held=held_of("box"))
    with working(request_of(press=too_deep)) as (shop, answers):
        failed = answers.all[answers.wait(lambda one: isinstance(one, Failed))]
        assert isinstance(failed, Failed)
        assert "press less deep" in failed.text
        shop.want(request_of(press=PRESS))
        answers.wait(lambda one: isinstance(one, Look))


def test_an_object_that_is_dragged_sideways_is_pressed_first() -> None:
    still = replace(PRESS, held=held_of("sphere"))
    assert asked_press(still).shear_mm is None
    asked = asked_press(replace(still, sideways_mm=(0.2, -0.1)))
    assert (asked.at_mm, asked.depth_mm, asked.shear_mm) == (PRESS.place_mm, 2.0, (0.2, -0.1))


def test_two_tips_are_dragged_on_one_surface_and_refused_if_they_overlap() -> None:
    two = LivePress(x_mm=7.0, y_mm=10.0, depth_mm=1.0, second_mm=(14.0, 10.0, 0.5))
    looks, seen = {}, {}
    with working() as (shop, answers):
        for press in (
            two,
            replace(two, second_mm=(14.0, 10.0, 0.0)),
            replace(two, depth_mm=0.0, second_mm=(14.0, 10.0, 0.0)),
        ):
            before = len(answers.all)
            shop.want(request_of(press=press, with_rays=True))
            looks[press] = answers.all[answers.wait(lambda one: isinstance(one, Look), before)]
            seen[press] = answers.all[answers.wait(lambda one: isinstance(one, Readings), before)]
        before = len(answers.all)
        shop.want(request_of(press=replace(two, second_mm=(8.0, 10.0, 0.5))))
        failed = answers.all[answers.wait(lambda one: isinstance(one, Failed), before)]
        assert isinstance(failed, Failed)
        assert "overlap" in failed.text
        assert "move them apart" in failed.text
    both, alone, none = looks.values()
    for (x, y), depth in (((7.0, 10.0), 1.0), ((14.0, 10.0), 0.5)):
        near = np.hypot(*(both.points_mm[:, :2] - (x, y)).T) < 1.0
        assert both.points_mm[near, 2].min() == pytest.approx(8.0 - depth, abs=0.05)
    (first, first_alone), (second, second_alone) = both.tips_n
    assert first > first_alone > second > second_alone > 0.0
    assert both.force_n == pytest.approx(first + second)
    assert alone.tips_n == ((first_alone, first_alone), (0.0, 0.0))
    assert none.tips_n == ((0.0, 0.0), (0.0, 0.0))
    assert (none.points_mm[:, 2] == 8.0).all()
    of_both, of_one, of_none = seen.values()
    assert np.abs(of_both.changes - of_one.changes).max() > 3.0
    assert (of_none.changes == 0.0).all()
