"""The computations behind the page: one thread computes results for the newest request, and stops outdated work.

    pairs under the tip ──► pressed top ──► rays ──► draft map ──► draft bounds ──► score ──► tolerance, sensitivity
                                                                                        ──► the same pairs, finely

An object that presses in place of the tip, and two tips at once, have a pressed top and the readings of all pairs;
verdict, map and score are always those of one tip.

A request is a design, a press, and options. A new design stops the running work. Only the computation of the pressed
top, of the pairs under the tip, or of the readings under an object or two tips is finished, since it takes only a
moment and keeps dragging smooth. A new press does not stop a running score: its results are computed between two
portions of the score's light (`optopad.sims.optics.engine.threads.between_pieces`). Traced light is stored on disk, so
stopped work is not lost.
Each kind of result has a class, and each result the digest of its design.
"""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from optopad.design.arrays import FloatArray, IntArray
from optopad.design.draft import Draft
from optopad.design.errors import DesignError, OptopadError
from optopad.design.shape.cavity import cavity_of, pair_name
from optopad.design.spec import SensorDesign
from optopad.screen.figures import PadFigures, figures_of
from optopad.sims.contact.held.press import HeldPress
from optopad.sims.contact.held.tips import TipsPress, pressed_tips, require_apart
from optopad.sims.held import AskedPress, light_of_tops, pressed, require_asked, require_traced
from optopad.sims.score.objective import PlaceCurves
from optopad.sims.score.result import ContinuityScore
from optopad.studio.session import LivePress

Level = Literal["draft", "score", "whole"]


@dataclass(frozen=True, kw_only=True)
class Look:
    """The shape of the pressed top.

    Attributes
    ----------
    press : location and depth of the press
    points_mm : (n, 3) points of the top's mesh in the coordinate system of the cavity [mm]
    triangles : (m, 3) indices of points
    force_n, area_mm2 : load [N] and area of the contact [mm²]; 0 without contact, the area also under two tips
    pull_n : sideways force of an object on the pad [N]
    slip_share : share of the contact's area that slips [-]
    tips_n : force on each of two tips, and what it would be without the other [N]
    """

    digest: str
    press: LivePress
    points_mm: FloatArray
    triangles: IntArray
    force_n: float
    area_mm2: float
    pull_n: float = 0.0
    slip_share: float = 0.0
    tips_n: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Curves:
    """Signals against depth for the pairs under the tip."""

    digest: str
    found: PlaceCurves


@dataclass(frozen=True, kw_only=True)
class Ray:
    """One sample path of light: names of its kind and of its pair, and (n, 3) points in cavity coordinates [mm]."""

    kind: str
    pair: str
    places_mm: FloatArray


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Sample paths of light under a press."""

    digest: str
    press: LivePress
    rays: tuple[Ray, ...]


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Expected readings of a manufactured sensor.

    Attributes
    ----------
    untouched, pressed : (emitter, receiver) readings without contact, and under the press [counts]
    changes : (emitter, receiver) change of the readings [noise units]; None for a press by the design's own tip
    """

    digest: str
    press: LivePress
    untouched: FloatArray
    pressed: FloatArray
    changes: FloatArray | None = None


@dataclass(frozen=True, kw_only=True)
class LiveVerdict:
    """A verdict on a design.

    Attributes
    ----------
    level : accuracy of the verdict: "draft" from a coarse setting of the light model, "score" as by `optopad score` but
        without tolerance, "whole" with tolerance
    score : score with verdict, map and bounds
    """

    digest: str
    level: Level
    score: ContinuityScore

    def figures(self, design: SensorDesign) -> PadFigures:
        """The figures of the judged design, computed once, since the panel is drawn often."""
        known = vars(self)
        if "_figures" not in known:
            known["_figures"] = figures_of(design, self.score)
        found: PadFigures = known["_figures"]
        return found


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The stage of the running work (empty if no work is running), and the finished share of the stage, 0 to 1."""

    stage: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Failed:
    """The reason why there is no result for a design."""

    digest: str
    text: str


Result = Look | Curves | Rays | Readings | LiveVerdict | Progress | Failed


Post = Callable[[Result], None]
TOLD_EVERY_S = 0.15
OF_A_PRESS = ("curves", "look", "changes", "rays", "readings", "fine curves")
"""Names of the pieces of work that a new press makes outdated."""
RAY_PAIRS = 4
RAYS_A_PAIR = 8


@dataclass(frozen=True, kw_only=True)
class Request:
    """A request for results for a design and a press.

    Attributes
    ----------
    design, press : a design without errors, and the press
    with_rays : whether to compute sample rays under the tip
    with_readings : whether to compute readings of a manufactured sensor; those under an object always are
    is_thorough : whether to compute the full score after the drafts
    """

    design: SensorDesign
    press: LivePress
    with_rays: bool = False
    with_readings: bool = False
    is_thorough: bool = True


class _StaleError(Exception):
    """Raised to stop work on a design or press that is no longer the present one."""


class Workshop:
    """Computes results for the newest request, on its own thread.

    Parameters
    ----------
    post : called with every result on the workshop's thread; must not block
    seed : random seed of the light model
    """

    def __init__(self, post: Post, *, seed: int = 0) -> None:
        self._post, self._seed = post, seed
        self._request: Request | None = None
        self._is_closing = False
        self._changed = threading.Condition()
        self._done: set[tuple[object, ...]] = set()
        self._under_way = ""
        self._key: tuple[object, ...] = ()
        self._digest = ""
        self._is_nested = False
        self._draft: LiveVerdict | None = None
        self._untouched: tuple[str, FloatArray] | None = None
        self._held: tuple[tuple[str, LivePress], HeldPress | TipsPress | None] | None = None
        self._responded = ""
        self._told_at = 0.0
        self._jobs = 0
        self._thread = threading.Thread(target=self._run, name="studio-workshop", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def want(self, request: Request | None) -> None:
        """Replace the present request; if it is None, all work stops."""
        with self._changed:
            self._request = request
            self._changed.notify()

    @property
    def running_jobs(self) -> int:
        """Number of requests that are being computed, 0 or 1."""
        return self._jobs

    def close(self, wait_s: float = 5.0) -> None:
        """End the thread within `wait_s`; a running computation stops after its present portion of light."""
        with self._changed:
            self._is_closing = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(wait_s)

    def _run(self) -> None:
        from optopad.sims.compiling import compiling_told
        from optopad.sims.optics.engine.threads import between_pieces

        with between_pieces(self._attend), compiling_told(lambda share: self._doing("kernels", share)):
            while not self._is_closing:
                try:
                    if not self._work_once():
                        self._rest()
                except _StaleError:
                    continue

    def _rest(self) -> None:
        self._under_way = ""
        self._post(Progress(stage="", share=1.0))
        with self._changed:
            self._changed.wait_for(lambda: self._is_closing or self._next(self._request) is not None)

    def _work_once(self) -> bool:
        """Do the next piece of work; returns False if there is none."""
        request = self._request
        found = self._next(request)
        if request is None or found is None:
            return False
        if request.design.digest != self._digest:
            self._digest, self._done, self._draft = request.design.digest, set(), None
        name, key, do = found
        self._jobs += 1
        try:
            self._do(name, key, do, request)
        finally:
            self._jobs -= 1
        return True

    def _do(
        self, name: str, key: tuple[object, ...], do: Callable[[Request], Result | None], request: Request
    ) -> None:
        former = (self._under_way, self._key)
        self._under_way, self._key = name, key
        try:
            found = do(request)
        except _StaleError:
            raise
        except OptopadError as err:
            self._give_up(request, key, str(err), is_of_all=isinstance(err, DesignError))
        except Exception as err:  # all, on purpose: the page must live on
            traceback.print_exception(err)
            self._give_up(
                request, key, f"optopad's own failure ({type(err).__name__}: {err}); please report it"
            )
        else:
            self._done = {one for one in self._done if one[0] != key[0]} | {key}  # one press at a time
            if found is not None:
                self._post(found)
        finally:
            self._under_way, self._key = former

    def _give_up(
        self, request: Request, key: tuple[object, ...], text: str, *, is_of_all: bool = False
    ) -> None:
        """Mark a failed piece of work as done and report the reason.

        If the piece belongs to a press, all pieces of this press are marked as done; if `is_of_all`, all of the design.
        """
        keys = {one for _, one, _ in self._pieces(request)}
        if not is_of_all:
            keys = {one for one in keys if one[0] in OF_A_PRESS} if key[0] in OF_A_PRESS else {key}
        self._done |= keys
        self._post(Failed(digest=request.design.digest, text=text))

    def _next(
        self, request: Request | None
    ) -> tuple[str, tuple[object, ...], Callable[[Request], Result | None]] | None:
        if request is None:
            return None
        done = self._done if request.design.digest == self._digest else set()
        return next((piece for piece in self._pieces(request) if piece[1] not in done), None)

    def _pieces(
        self, request: Request
    ) -> list[tuple[str, tuple[object, ...], Callable[[Request], Result | None]]]:
        """Pieces of work for a request, in order, as (name, key, function); a result with an old key is outdated."""
        press = request.press
        pieces: list[tuple[str, tuple[object, ...], Callable[[Request], Result | None]]]
        if not press.is_single_tip:
            pieces = [
                ("look", ("look", press), self._held_look),
                ("changes", ("changes", press), self._held_readings),
            ]
        else:
            pieces = [
                ("curves", ("curves", press.place_mm), self._curves),
                ("look", ("look", press), self._look),
            ]
            if request.with_rays:
                pieces.append(("rays", ("rays", press), self._rays))
            if request.with_readings:
                pieces.append(("readings", ("readings", press), self._readings))
        pieces += [("map", ("draft",), self._draft_map), ("bounds", ("bounds",), self._draft_bounds)]
        if request.is_thorough:
            pieces.append(("score", ("score",), self._score))
            if press.is_single_tip:
                pieces.append(("fine curves", ("fine curves", press.place_mm), self._fine_curves))
        return pieces

    def _attend(self) -> None:
        """Stop outdated work and serve a new press; called between two portions of light."""
        request = self._request
        if self._is_closing or request is None:
            raise _StaleError
        if self._under_way in ("look", "curves"):
            return
        keys = {key for _, key, _ in self._pieces(request)}
        if request.design.digest != self._digest or (self._under_way != "changes" and self._key not in keys):
            raise _StaleError
        is_own_thread = threading.current_thread() is self._thread  # a live contact solve has others
        if is_own_thread and not self._is_nested and self._key[0] not in OF_A_PRESS:
            self._serve(request)

    def _serve(self, request: Request) -> None:
        """Do one piece of work for a new press, during a computation that depends only on the design."""
        piece = self._next(request)
        if piece is None or piece[0] not in OF_A_PRESS or piece[0] == "fine curves":
            return
        self._is_nested = True
        try:
            self._do(*piece, request)
        except _StaleError:
            pass  # a newer press, or no request: the running work checks by itself
        finally:
            self._is_nested = False

    def _step(self, stage: str, share: float) -> None:
        self._doing(stage, share)
        self._attend()

    def _contact_step(self, share: float) -> None:
        """Report the progress of a contact solution; stop it if its design is no longer the present one."""
        self._doing("contact", share)
        request = self._request
        if self._is_closing or request is None or request.design.digest != self._digest:
            raise _StaleError

    def _doing(self, stage: str, share: float) -> None:
        now = time.monotonic()
        if not self._is_nested and (now - self._told_at > TOLD_EVERY_S or stage == "kernels"):
            self._told_at = now
            self._post(Progress(stage=stage, share=share))

    def _look(self, request: Request) -> Look:
        from optopad.studio.pad_mesh import pressed_top

        design, press = request.design, request.press
        points, triangles, surface = pressed_top(design, press.place_mm, press.depth_mm)
        return Look(
            digest=design.digest,
            press=press,
            points_mm=points,
            triangles=triangles,
            force_n=0.0 if surface is None else surface.near.force_n,
            area_mm2=0.0 if surface is None else math.pi * surface.near.contact_radius_mm**2,
        )

    def _held_look(self, request: Request) -> Look:
        from optopad.studio.pad_mesh import held_top, untouched_top

        if request.design.digest != self._responded:
            self._doing("response of the pad to objects", 0.0)
            self._responded = request.design.digest
        found = self._held_press(request)
        digest, press = request.design.digest, request.press
        if found is None:
            points, triangles = untouched_top(cavity_of(request.design).plan)
            more: dict[str, Any] = {"force_n": 0.0, "area_mm2": 0.0, "tips_n": ((0.0, 0.0), (0.0, 0.0))}
            return Look(digest=digest, press=press, points_mm=points, triangles=triangles, **more)
        points, triangles = held_top(request.design, found.top)
        if isinstance(found, HeldPress):
            more = {
                "force_n": found.force_n,
                "area_mm2": found.area_mm2,
                "pull_n": math.hypot(*found.pull_n),
                "slip_share": found.slip_share,
            }
        else:
            both = zip(found.force_n.tolist(), found.alone_n.tolist(), strict=True)
            is_touching = [depth > 0.0 for *_, depth in press.tips_mm]
            more = {
                "force_n": float(found.force_n.sum()),
                "area_mm2": 0.0,
                "tips_n": tuple(next(both) if one else (0.0, 0.0) for one in is_touching),
            }
        return Look(digest=digest, press=press, points_mm=points, triangles=triangles, **more)

    def _held_press(self, request: Request) -> HeldPress | TipsPress | None:
        """The contact of the object or of the two tips that press, solved once; None if no tip touches."""
        key = (request.design.digest, request.press)
        if self._held is None or self._held[0] != key:
            draft = Draft.of(request.design)
            if request.press.held is not None:
                asked = asked_press(request.press)
                require_asked(draft, asked)
                self._held = key, pressed(draft, asked)
            else:
                self._held = key, self._pressed_tips(draft, np.array(request.press.tips_mm))
        return self._held[1]

    def _pressed_tips(self, draft: Draft, tips_mm: FloatArray) -> TipsPress | None:
        from optopad.sims.contact.indentation import round_press
        from optopad.sims.contact.scope import contact_of

        require_traced(draft, "touches")
        require_apart(draft, tips_mm)
        if not (tips_mm[:, 2] > 0.0).any():
            return None
        contact = contact_of(draft.design)
        round_press(contact, on_step=self._contact_step)  # only if it is solved live
        return pressed_tips(contact, tips_mm)

    def _held_readings(self, request: Request) -> Readings:
        """Expected readings under the object or the tips that press, from each pair's change of light."""
        design, press, found = request.design, request.press, self._held_press(request)
        light = light_of_tops(
            Draft.of(design),
            [None if found is None else found.top],
            reflectance=None if press.held is None else asked_press(press).reflectance,
            accuracy="draft",
            seed=self._seed,
        )
        return Readings(
            digest=design.digest,
            press=press,
            untouched=light.readout.counts(light.untouched),
            pressed=light.readout.counts(light.flux[0]),
            changes=light.changes[0],
        )

    def _curves(self, request: Request) -> Curves:
        from optopad.sims.contact.indentation import round_press
        from optopad.sims.contact.scope import contact_of
        from optopad.sims.score.objective import curves_under

        round_press(contact_of(request.design), on_step=self._contact_step)  # only if it is solved live
        found = curves_under(request.design, request.press.place_mm, seed=self._seed)
        return Curves(digest=request.design.digest, found=found)

    def _fine_curves(self, request: Request) -> Curves:
        from optopad.sims.score.objective import curves_under

        found = curves_under(
            request.design, request.press.place_mm, is_draft=False, seed=self._seed, on_step=self._step
        )
        return Curves(digest=request.design.digest, found=found)

    def _rays(self, request: Request) -> Rays:
        from optopad.sims.rays import LOST, RayChoice, kind_of, ray_states
        from optopad.sims.score.objective import pairs_under

        cavity, press = cavity_of(request.design), request.press
        pairs = pairs_under(cavity, press.place_mm)[:RAY_PAIRS]
        choice = RayChoice(
            pairs=pairs,
            count=RAYS_A_PAIR,
            draws_each_pair=True,
            pool_per_path=4,
            most_rays=20_000,
            accuracy="draft",
            seed=self._seed,
        )
        presses = [(*press.place_mm, press.depth_mm)] if press.depth_mm > 0 else []
        state = ray_states(request.design, choice, presses, on_step=lambda share: self._step("rays", share))[
            -1
        ]
        rays = [
            Ray(
                kind=kind_of(path.fate).key,
                pair=pair_name(cavity, (path.emitter, path.receiver)),
                places_mm=path.places_mm,
            )
            for path in state.paths
        ]
        rays += [
            Ray(kind=LOST.key, pair=pair_name(cavity, (path.emitter, former)), places_mm=path.places_mm)
            for path, former in zip(state.lost, state.lost_by, strict=True)
        ]
        return Rays(digest=request.design.digest, press=press, rays=tuple(rays))

    def _readings(self, request: Request) -> Readings:
        """Expected readings: untouched as in `driver check`, and under the press, from each pair's change of light."""
        from optopad.sensor import simulated_gain
        from optopad.sims.optics.tracing import trace

        design, press = request.design, request.press
        if self._untouched is None or self._untouched[0] != design.digest:
            gain = simulated_gain(design, seed=self._seed, on_step=self._step)
            self._untouched = (design.digest, gain.untouched_readings(design))
        untouched = self._untouched[1]
        flux = trace(
            Draft.of(design),
            np.array([[*press.place_mm, 0.0], [*press.place_mm, press.depth_mm]]),
            accuracy="draft",
            seed=self._seed,
        ).flux
        share = np.where(flux[0] > 0, flux[1] / np.where(flux[0] > 0, flux[0], 1.0), 1.0)
        return Readings(digest=design.digest, press=press, untouched=untouched, pressed=untouched * share)

    def _draft_map(self, request: Request) -> LiveVerdict:
        from optopad.sims.score.objective import draft_score

        found = draft_score(request.design, seed=self._seed, on_step=self._step)
        self._draft = LiveVerdict(digest=request.design.digest, level="draft", score=found)
        return self._draft

    def _draft_bounds(self, request: Request) -> LiveVerdict | None:
        from optopad.sims.score.objective import with_draft_bounds

        if self._draft is None or self._draft.score.pad_map is None:
            return None
        return replace(
            self._draft, score=with_draft_bounds(request.design, self._draft.score, on_step=self._step)
        )

    def _score(self, request: Request) -> LiveVerdict:
        """The score as by `optopad score`, posted first without and then with tolerance."""
        from optopad.sims.score.build_tolerance import with_tolerance
        from optopad.sims.score.field_steps import with_field_steps
        from optopad.sims.score.scoring import score
        from optopad.sims.score.trials import with_trial

        design = request.design
        found = score(design, tolerance=False, seed=self._seed, on_step=self._step)
        if found.verdict == "OUT_OF_MODEL_SCOPE":
            return LiveVerdict(digest=design.digest, level="whole", score=found)
        self._post(LiveVerdict(digest=design.digest, level="score", score=found))
        found = with_tolerance(design, found, seed=self._seed, on_step=self._step)
        found = with_field_steps(design, found, seed=self._seed, on_step=self._step)
        found = with_trial(design, found, seed=self._seed, on_step=self._step)
        return LiveVerdict(digest=design.digest, level="whole", score=found)


def asked_press(press: LivePress) -> AskedPress:
    """The press of an object as the contact model takes it."""
    assert press.held is not None
    shear = press.sideways_mm if any(press.sideways_mm) else None
    return AskedPress(held=(press.held,), at_mm=press.place_mm, depth_mm=press.depth_mm, shear_mm=shear)
