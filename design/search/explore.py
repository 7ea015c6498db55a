"""Search for better designs: propose designs, judge them, learn from the results, and repeat.

    open study ──► base design judged once ──► limits as numbers
        ┌──────────────────────────────────────────────┐
        └► propose a batch ──► judge it (here, or fanned out) ──► record each design as it comes ┘

Each judged design is recorded at once, so an interruption loses none. The objective is an argument, so this module does
not depend on the light model. A whole batch is proposed before its designs are judged, and each proposal has a seed
that depends on its position. The same space, seed and batch size therefore give the same designs for any number of
processes, any order of the results, and any interruptions. Shared studies are the exception: a worker's proposals
depend on the designs that other workers have finished. Designs are numbered by their place in this order; a design
that is proposed again after its process died keeps its number.

A study is the record of a search. It is stored in a database that Optuna manages, either a SQLite file in the search's
folder or a database at a given address. Several processes (workers) may share one study. A sampler proposes the
designs. The study contains the digest of its search space, and a search with a different space is refused. If a process
is killed, its unfinished designs are proposed again with the same values of their fields.
"""

from __future__ import annotations

import hashlib
import importlib.util
import itertools
import math
import os
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
import sqlalchemy
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.importance import PedAnovaImportanceEvaluator
from optuna.samplers import BaseSampler
from optuna.storages import RDBStorage
from optuna.trial import FrozenTrial, TrialState

from optopad.design.arrays import BoolArray, FloatArray
from optopad.design.errors import DesignError, InputError
from optopad.design.search.improve import FanOut, Judged, Limit, Objective, Tried, limits_of, one_by_one
from optopad.design.search.space import ROUND_DIGITS, SearchSpace, SpaceField, Value
from optopad.design.spec import SensorDesign

DIGEST, SPACE, MAKER, QUEUED = "space_digest", "space", "maker", "queued"
CONNECT_TIMEOUT_S = 10
LOCK_TIMEOUT_S = 120
CREATE_ATTEMPTS = 8
GRACE_BEATS = 3
"""Number of heartbeats that a worker may miss before its unfinished designs go to other workers."""
MAX_GRID = 100_000
POPULATION = 32
"""Number of designs in a generation of the sampler NSGA-II.

It is smaller than Optuna's 50, so that a few hundred designs make more generations.
"""
QUEUE_PATIENCE_S = 30
"""Longest time that a worker waits for another worker to queue the first designs of a shared study [s]."""
FINISHED = (TrialState.COMPLETE, TrialState.PRUNED)


@contextmanager
def opened_study(space: SearchSpace, url: str, *, heartbeat_s: int | None = None) -> Iterator[optuna.Study]:
    """Context manager that yields the study of a search space; the study is created if it does not exist.

    Parameters
    ----------
    url : address of the database, such as sqlite:///folder/study.db or postgresql://user@host/name
    heartbeat_s : period of a worker's heartbeat in a shared study [s]; None if the study is not shared

    Raises
    ------
    InputError : the database cannot be reached, or has a study with this name but a different search space.
    """
    require_sampler(space)
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with storage_errors(url):
        storage = _storage_with_tables(url, heartbeat_s)
        try:
            study = _made_or_found(space, storage)
            _require_same_space(study, space, url)
            yield study
        finally:
            storage.remove_session()
            storage.engine.dispose()


def _require_same_space(study: optuna.Study, space: SearchSpace, url: str) -> None:
    known = study.user_attrs.get(DIGEST)
    if known is None and not study.get_trials(deepcopy=False):
        study.set_user_attr(SPACE, space.model_dump(mode="json"))
        study.set_user_attr(DIGEST, space.digest)
    elif known != space.digest:
        raise InputError(
            f"{shown_url(url)}: the study {space.name!r} is of another search space (digest "
            f"{str(known)[:8]}, this one is {space.digest[:8]}); rename the space, or restore the old one"
        )


def _made_or_found(space: SearchSpace, storage: RDBStorage) -> optuna.Study:
    try:
        directions = [objective.sense for objective in space.objectives]
        study = optuna.create_study(study_name=space.name, storage=storage, directions=directions)
    except optuna.exceptions.DuplicatedStudyError:
        return optuna.load_study(study_name=space.name, storage=storage)
    study.set_user_attr(MAKER, _me())
    return study


@contextmanager
def storage_errors(url: str) -> Iterator[None]:
    """Context manager that converts errors of a database into an InputError with a message for the user."""
    try:
        yield
    except (sqlalchemy.exc.SQLAlchemyError, optuna.exceptions.StorageInternalError, ImportError) as err:
        root: BaseException = err.__cause__ or err
        reason = str(getattr(root, "orig", None) or root).strip().splitlines()[0]
        raise InputError(
            f"--storage: {shown_url(url)} cannot be reached: {reason}; check address, server and rights "
            "(finished designs are kept; the same command continues the search)"
        ) from err


def shown_url(url: str) -> str:
    """Address of a database without its password."""
    try:
        return sqlalchemy.engine.make_url(url).render_as_string(hide_password=True)
    except sqlalchemy.exc.ArgumentError:
        return repr(url)


def _storage_with_tables(url: str, heartbeat_s: int | None) -> RDBStorage:
    """Open the storage of a study in a database, with several attempts.

    If workers create tables at the same time, all but one fail at first.
    """
    for _ in range(CREATE_ATTEMPTS - 1):
        try:
            return _storage(url, heartbeat_s)
        except (sqlalchemy.exc.IntegrityError, sqlalchemy.exc.ProgrammingError):
            time.sleep(0.5)
    return _storage(url, heartbeat_s)


def _storage(url: str, heartbeat_s: int | None) -> RDBStorage:
    is_sqlite = url.startswith("sqlite")
    if url.startswith(("postgresql://", "postgres://")):
        url = f"postgresql+psycopg://{url.partition('://')[2]}"
    connect = {"timeout": LOCK_TIMEOUT_S} if is_sqlite else {}
    if url.startswith("postgresql+psycopg"):
        connect = {"connect_timeout": CONNECT_TIMEOUT_S}
    with warnings.catch_warnings():
        # Heartbeats are marked as experimental since Optuna 2.9 and unchanged since then; `_Run._beating` sends them.
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        storage = RDBStorage(
            url,
            engine_kwargs={"connect_args": connect, "pool_pre_ping": not is_sqlite},
            heartbeat_interval=heartbeat_s,
            grace_period=None if heartbeat_s is None else GRACE_BEATS * heartbeat_s,
            heartbeat_stale_trial_callback=_propose_again,
        )
    if is_sqlite:
        sqlalchemy.event.listen(storage.engine, "connect", _write_ahead)
        storage.engine.dispose()  # connections opened earlier lack this setting
    return storage


def _write_ahead(connection: Any, _: Any) -> None:
    """Set SQLite to write-ahead logging, which is ten times faster.

    If the process is killed, no data are lost. A power cut may lose the last seconds but does not damage earlier data.
    """
    for pragma in ("journal_mode=WAL", "synchronous=NORMAL"):
        connection.execute(f"PRAGMA {pragma}")


def distributions_of(space: SearchSpace) -> dict[str, BaseDistribution]:
    """Optuna's distribution of each field of a search space, by dotted path; choices appear as their labels."""
    return {field.path: _distribution(space, field) for field in space.fields}


def _distribution(space: SearchSpace, field: SpaceField) -> BaseDistribution:
    if field.choices is not None:
        return CategoricalDistribution(field.labels)
    assert field.low is not None
    assert field.high is not None
    if space.is_whole(field):
        return IntDistribution(
            round(field.low), round(field.high), log=field.log, step=round(field.step or 1.0)
        )
    return FloatDistribution(field.low, field.high, log=field.log, step=field.step)


def require_sampler(space: SearchSpace) -> None:
    """Refuse a sampler whose library is missing, or a grid with too many points.

    Raises
    ------
    InputError : the library of the sampler is not installed.
    DesignError : the grid of a grid search has more than `MAX_GRID` points.
    """
    sampler = space.search.sampler
    if sampler == "gp" and importlib.util.find_spec("torch") is None:
        raise InputError(
            'search.sampler: "gp" needs the package torch; install it (pip install torch), or write "tpe"'
        )
    if sampler == "grid" and grid_size(space) > MAX_GRID:
        raise DesignError(
            f"fields: the grid has {grid_size(space)} points, at most {MAX_GRID}; take larger steps or another sampler"
        )


def grid_size(space: SearchSpace) -> int:
    """Number of points in the complete grid of a search space."""
    return math.prod(len(space.values_of(field) or ()) for field in space.fields)


def sampler_of(space: SearchSpace, index: int, worker: str) -> BaseSampler:
    """Sampler for one proposal; its seed depends on `index`, so that a resumed search gives the same designs.

    Parameters
    ----------
    index : number of designs proposed so far
    worker : name of the worker in a shared study; empty if the study is not shared
    """
    key = f"{space.search.seed}:{index}:{worker}".encode()
    seed = int.from_bytes(hashlib.sha256(key).digest()[:4], "big")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        match space.search.sampler:
            case "tpe":
                return optuna.samplers.TPESampler(seed=seed, n_startup_trials=max(10, 4 * len(space.fields)))
            case "nsga2":
                return optuna.samplers.NSGAIISampler(seed=seed, population_size=POPULATION)
            case "gp":
                return optuna.samplers.GPSampler(seed=seed, deterministic_objective=True)
            case "qmc":
                return optuna.samplers.QMCSampler(
                    scramble=True, seed=space.search.seed, warn_independent_sampling=False
                )
            case _:  # all points of the grid are queued, so that nothing is sampled
                return optuna.samplers.RandomSampler(seed=seed)


def queue_first(
    study: optuna.Study, space: SearchSpace, *, is_shared: bool, first: Sequence[dict[str, Value]] = ()
) -> None:
    """Queue the first designs of a study, if this has not been done before.

    For the grid sampler these are all points of the grid. Otherwise they are the base design, if it is in the space,
    and then the points of `first`.

    If workers start at the same time, the one that creates the study queues the designs. The others wait up to
    `QUEUE_PATIENCE_S` for this.
    """
    for _ in range(QUEUE_PATIENCE_S if is_shared else 0):
        if study.user_attrs.get(QUEUED) is not None or study.user_attrs.get(MAKER) in (None, _me()):
            break
        time.sleep(1.0)
    if study.user_attrs.get(QUEUED) is not None:
        return
    if space.search.sampler == "grid":
        _queue_grid(study, space)
    elif not study.get_trials(deepcopy=False):
        base = space.base_parameters()
        for point in (*([] if base is None else [base]), *first):
            study.enqueue_trial(point)
    study.set_user_attr(QUEUED, True)


def _me() -> str:
    return f"{socket.gethostname()}:{os.getpid()}"


def _queue_grid(study: optuna.Study, space: SearchSpace) -> None:
    paths = [field.path for field in space.fields]
    known = {_point(trial) for trial in study.get_trials(deepcopy=False) if trial.state != TrialState.FAIL}
    for values in itertools.product(*(space.values_of(field) or [] for field in space.fields)):
        point = dict(zip(paths, values, strict=True))
        if tuple(sorted(point.items())) not in known:
            study.enqueue_trial(point)


def recover(study: optuna.Study, *, is_shared: bool) -> None:
    """Queue the unfinished designs of killed processes again.

    In a shared study these are the designs without a recent heartbeat; otherwise they are all designs marked as
    running.
    """
    if is_shared:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            optuna.storages.fail_stale_trials(study)
    else:
        release(study, [trial.number for trial in trials_in(study, TrialState.RUNNING)])


def beat(study: optuna.Study, trial_ids: Sequence[int]) -> None:
    """Record heartbeats of running designs in a shared study; Optuna has no public function for it."""
    storage: Any = study._storage
    for trial_id in trial_ids:
        getattr(storage, "_backend", storage).record_heartbeat(trial_id)


def release(study: optuna.Study, numbers: Sequence[int]) -> None:
    """Mark designs that were proposed but not judged as failed, and queue them again."""
    for number in numbers:
        trial = next(one for one in study.get_trials(deepcopy=False) if one.number == number)
        if not trial.state.is_finished():
            study.tell(number, state=TrialState.FAIL)
            _propose_again(study, trial)


def trials_in(study: optuna.Study, *states: TrialState) -> list[FrozenTrial]:
    """Optuna's trials (designs) that are in any of the given states, in the order of their numbers."""
    return study.get_trials(deepcopy=False, states=states)


def _propose_again(study: optuna.Study, trial: FrozenTrial) -> None:
    """Queue the values of a lost trial again, provided that every field had a value."""
    point = trial.system_attrs.get("fixed_params") or trial.params
    wanted = {field["path"] for field in study.user_attrs[SPACE]["fields"]}
    if set(point) == wanted:
        place = trial.user_attrs.get(PLACE)
        study.enqueue_trial(point, user_attrs=None if place is None else {PLACE: place})


def _point(trial: FrozenTrial) -> tuple[tuple[str, Value], ...]:
    found: dict[str, Any] = trial.system_attrs.get("fixed_params") or trial.params
    return tuple(sorted(found.items()))


BASE, JUDGED, ROUNDS, PLACE = "base", "judged", "rounds", "place"
HEARTBEAT_S = 20


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Results of a search so far.

    Attributes
    ----------
    space : the search space
    base : result of the objective for the base design
    limits : limits that a feasible design must satisfy
    tried : finished designs, in the order of their proposal
    front : Pareto front: the feasible designs that no other feasible design dominates
    wanted : requested number of designs
    is_interrupted : whether the user stopped the search before the number `wanted` was reached
    """

    space: SearchSpace
    base: Judged
    limits: tuple[Limit, ...]
    tried: tuple[Tried, ...]
    front: tuple[Tried, ...]
    wanted: int
    is_interrupted: bool = False


OnTried = Callable[[Findings, Tried | None], None]
"""Callback at the start and after each design. It receives the results so far and the design, or None at the start."""

Refine = Callable[[Findings, int], Sequence[dict[str, Value]]]
"""Function that returns more points to judge after all of the sampler's designs have been judged.

It receives the results so far and the number of the round, from 0. It is called again after each round until it returns
no points.
"""


@dataclass(frozen=True, kw_only=True)
class _Asked:
    trial: optuna.Trial
    design: SensorDesign | None
    refusal: str


def explore(
    space: SearchSpace,
    objective: Objective,
    url: str,
    *,
    trials: int | None = None,
    is_shared: bool = False,
    fan_out: FanOut = one_by_one,
    on_tried: OnTried | None = None,
    heartbeat_s: int = HEARTBEAT_S,
    first: Sequence[dict[str, Value]] = (),
    refine: Refine | None = None,
) -> Findings:
    """Search until a given number of designs is judged; an existing study is continued.

    Parameters
    ----------
    objective : function that judges one design
    url : address of the study's database
    trials : total number of designs, including those of earlier runs; if None, the number in the space's settings
    is_shared : whether other processes may work on the study at the same time
    fan_out : function that judges a batch of designs, for example in several processes
    on_tried : callback at the start and after every design
    heartbeat_s : period of a worker's heartbeat in a shared study [s]
    first : points of the space to judge before the sampler's proposals
    refine : function that returns more points to judge after `trials` designs; not for a shared study

    Raises
    ------
    InputError : the database cannot be reached, or its study has a different search space; judged designs remain
        recorded.
    DesignError : the grid is too large, or a limit cannot be computed from the base design.
    """
    with opened_study(space, url, heartbeat_s=heartbeat_s if is_shared else None) as study:
        run = _Run(
            space,
            objective,
            study,
            trials or space.search.trials,
            is_shared,
            fan_out,
            on_tried,
            heartbeat_s,
            first,
            refine,
        )
        return run.to_the_end()


def findings_of(space: SearchSpace, url: str, *, wanted: int) -> Findings:
    """Results of an existing study, without continuing the search; `wanted` is the requested number of designs."""
    with opened_study(space, url) as study:
        base = _judged_from(study.user_attrs.get(BASE) or {})
        return _findings(study, space, base, limits_of(space, base), wanted)


class _Run:
    """One process of a search: its search space, objective, study and settings."""

    def __init__(
        self,
        space: SearchSpace,
        objective: Objective,
        study: optuna.Study,
        wanted: int,
        is_shared: bool,
        fan_out: FanOut,
        on_tried: OnTried | None,
        heartbeat_s: int,
        first: Sequence[dict[str, Value]],
        refine: Refine | None,
    ) -> None:
        self.refine = refine
        self.space, self.objective, self.study, self.fan_out = space, objective, study, fan_out
        self.is_shared, self.on_tried, self.heartbeat_s = is_shared, on_tried, heartbeat_s
        self.first = first
        is_grid = space.search.sampler == "grid"
        self.wanted = min(wanted, grid_size(space)) if is_grid else wanted
        self.wanted = max(self.wanted, *study.user_attrs.get(ROUNDS, ()), 0)
        self.worker = f"{socket.gethostname()}:{os.getpid()}:{time.time_ns()}" if is_shared else ""
        self.distributions = distributions_of(space)
        self.base = self._base()
        self.limits = limits_of(space, self.base)

    def to_the_end(self) -> Findings:
        recover(self.study, is_shared=self.is_shared)
        queue_first(self.study, self.space, is_shared=self.is_shared, first=self.first)
        self._tell_listener(None)
        is_interrupted = False
        try:
            while size := self._next_size() or self._next_round():
                self._batch(size)
                if self.is_shared:
                    recover(self.study, is_shared=True)
        except KeyboardInterrupt:
            is_interrupted = True
        return _findings(self.study, self.space, self.base, self.limits, self.wanted, is_interrupted)

    def _next_round(self) -> int:
        """Queue the points that `refine` returns when all other designs are judged; return their first batch's size."""
        if self.refine is None:
            return 0
        rounds = list(self.study.user_attrs.get(ROUNDS, ()))
        found = _findings(self.study, self.space, self.base, self.limits, self.wanted)
        known = [one.parameters for one in found.tried]
        points = [point for point in self.refine(found, len(rounds)) if point not in known]
        if not points:
            return 0
        self.wanted = len(found.tried) + len(points)
        self.study.set_user_attr(ROUNDS, [*rounds, self.wanted])
        for point in points:
            self.study.enqueue_trial(point)
        return self._next_size()

    def _base(self) -> Judged:
        known = self.study.user_attrs.get(BASE)
        if known is None:
            known = _record(self.objective(self.space.base, ()), self.space.base.digest, 0.0)
            self.study.set_user_attr(BASE, known)
        return _judged_from(known)

    def _next_size(self) -> int:
        """Number of designs in the next batch; 0 if none remain and no other worker is still judging designs."""
        waited, seen = 0.0, -1
        while True:
            finished = len(trials_in(self.study, *FINISHED))
            running = len(trials_in(self.study, TrialState.RUNNING))
            room = self.wanted - finished - running
            if room > 0:
                return min(room, self._batch_size(finished + running))
            if running == 0 or not self.is_shared or waited > 3 * GRACE_BEATS * self.heartbeat_s:
                return 0
            waited, seen, before = (0.0, finished, 0.0) if finished != seen else (waited + 0.5, seen, waited)
            time.sleep(0.5)
            recover(self.study, is_shared=True)
            if before <= GRACE_BEATS * self.heartbeat_s < waited:
                # The rest has a heartbeat, or its worker was killed before the first one. One beat in its place makes
                # it expire.
                beat(self.study, [trial._trial_id for trial in trials_in(self.study, TrialState.RUNNING)])

    def _batch_size(self, before: int) -> int:
        """Number of designs that complete a batch; `before` is the number of designs so far.

        A resumed search then has the same batches as an uninterrupted one. With quasi-random points, the first batch
        has a single design, because Optuna needs one recorded design to define the space.
        """
        size = self.space.search.batch
        if self.space.search.sampler == "qmc":
            return 1 if before == 0 else size - (before - 1) % size
        return size - before % size

    def _batch(self, size: int) -> None:
        asked: list[_Asked] = []
        try:
            with self._beating(asked):
                for _ in range(size):
                    asked.append(self._ask())
                self._judge(asked)
        except BaseException:
            release(self.study, [one.trial.number for one in asked])
            raise

    def _ask(self) -> _Asked:
        before = len(trials_in(self.study, *FINISHED, TrialState.RUNNING))
        is_queued = bool(trials_in(self.study, TrialState.WAITING))
        sampler = sampler_of(self.space, before, self.worker)
        if is_queued and self.space.search.sampler == "qmc":
            sampler = optuna.samplers.RandomSampler()  # the point is queued: draw nothing
        self.study.sampler = sampler
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Heartbeat of storage", category=UserWarning)
            trial = self.study.ask(fixed_distributions=self.distributions)
        if self.is_shared:
            beat(self.study, [trial._trial_id])
        elif PLACE not in trial.user_attrs:
            trial.set_user_attr(PLACE, self._next_place())
        try:
            return _Asked(trial=trial, design=self.space.design_at(trial.params), refusal="")
        except DesignError as err:
            return _Asked(trial=trial, design=None, refusal=str(err).splitlines()[-1].strip())

    def _next_place(self) -> int:
        """Number of the designs proposed so far, without those that died and will not be proposed again."""
        alive = [one for one in self.study.get_trials(deepcopy=False) if one.state != TrialState.FAIL]
        return sum(PLACE in one.user_attrs for one in alive)

    def _judge(self, asked: list[_Asked]) -> None:
        for one in asked:
            if one.design is None:
                self._record(one, Judged(reason=one.refusal), 0.0)
        sound = [one for one in asked if one.design is not None]
        started = time.monotonic()
        designs = [one.design for one in sound if one.design is not None]
        for number, judged in self.fan_out(self.objective, designs, self.limits):
            now = time.monotonic()
            self._record(sound[number], judged, now - started)
            started = now

    def _record(self, one: _Asked, judged: Judged, seconds: float) -> None:
        wanted = [judged.figures.get(objective.figure) for objective in self.space.objectives]
        values = [value for value in wanted if value is not None]
        if not judged.reason and len(values) < len(wanted):
            missing = [o.figure for o, v in zip(self.space.objectives, wanted, strict=True) if v is None]
            judged = Judged(
                figures=judged.figures, verdict=judged.verdict, reason=f"{', '.join(missing)}: not resolved"
            )
        digest = one.design.digest if one.design is not None else ""
        one.trial.set_user_attr(JUDGED, _record(judged, digest, seconds))
        for name, miss in judged.violations(self.limits).items():
            one.trial.set_constraint(name, miss)
        if judged.reason:
            self.study.tell(one.trial, state=TrialState.PRUNED, skip_if_finished=True)
        else:
            self.study.tell(one.trial, values, skip_if_finished=True)
        self._tell_listener(one.trial.user_attrs.get(PLACE, one.trial.number))

    def _tell_listener(self, number: int | None) -> None:
        if self.on_tried is not None:
            found = _findings(self.study, self.space, self.base, self.limits, self.wanted)
            self.on_tried(found, next((one for one in found.tried if one.number == number), None))

    @contextmanager
    def _beating(self, asked: list[_Asked]) -> Iterator[None]:
        """Context manager that sends heartbeats for the designs that are being judged, if the study is shared."""
        if not self.is_shared:
            yield
            return
        done = threading.Event()
        pulse = threading.Thread(target=self._beat, args=(asked, done), daemon=True)
        pulse.start()
        try:
            yield
        finally:
            done.set()
            pulse.join()

    def _beat(self, asked: list[_Asked], done: threading.Event) -> None:
        while not done.wait(min(1.0, self.heartbeat_s / 2)):
            beat(self.study, [one.trial._trial_id for one in list(asked)])


def _findings(
    study: optuna.Study,
    space: SearchSpace,
    base: Judged,
    limits: tuple[Limit, ...],
    wanted: int,
    is_interrupted: bool = False,
) -> Findings:
    tried = sorted(
        (_tried(trial, limits) for trial in trials_in(study, *FINISHED)), key=lambda one: one.number
    )
    return Findings(
        space=space,
        base=base,
        limits=limits,
        tried=tuple(tried),
        front=pareto_front(space, tried),
        wanted=wanted,
        is_interrupted=is_interrupted,
    )


def _tried(trial: FrozenTrial, limits: tuple[Limit, ...]) -> Tried:
    record = trial.user_attrs[JUDGED]
    judged = _judged_from(record)
    is_met = all(miss <= 0.0 for miss in judged.violations(limits).values())
    return Tried(
        number=int(trial.user_attrs.get(PLACE, trial.number)),
        parameters={name: _rounded(value) for name, value in trial.params.items()},
        digest=str(record["digest"]),
        judged=judged,
        is_feasible=trial.state == TrialState.COMPLETE and is_met,
        seconds=float(record["seconds"]),
    )


def _rounded(value: Value) -> Value:
    return round(value, ROUND_DIGITS) if isinstance(value, float) else value


def _record(judged: Judged, digest: str, seconds: float) -> dict[str, Any]:
    return {
        "figures": judged.figures,
        "verdict": judged.verdict,
        "reason": judged.reason,
        "may_be": judged.may_be,
        "digest": digest,
        "seconds": round(seconds, 3),
    }


def _judged_from(record: dict[str, Any]) -> Judged:
    return Judged(
        figures=dict(record.get("figures", {})),
        verdict=str(record.get("verdict", "")),
        reason=str(record.get("reason", "")),
        may_be=bool(record.get("may_be", False)),
    )


def not_dominated(losses: FloatArray) -> BoolArray:
    """Array (n,) that is true for each design that no other design dominates.

    A design dominates another one if no loss of it is larger and at least one is smaller.

    Parameters
    ----------
    losses : (n, figure) numbers to minimise, one array row per design
    """
    kept = np.ones(len(losses), dtype=np.bool_)
    for row, loss in enumerate(losses):
        beaten_by = np.all(losses <= loss, axis=1) & np.any(losses < loss, axis=1)
        kept[row] = not beaten_by.any()
    return kept


def losses_of(space: SearchSpace, tried: Sequence[Tried]) -> FloatArray:
    """Objectives of designs as an array (n, objective), with signs chosen so that smaller is better."""
    rows = [
        [
            float(one.judged.figures[objective.figure] or 0.0) * (1 if objective.sense == "minimize" else -1)
            for objective in space.objectives
        ]
        for one in tried
    ]
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(space.objectives))


def pareto_front(space: SearchSpace, tried: Sequence[Tried]) -> tuple[Tried, ...]:
    """Feasible designs that no other dominates, without duplicates; the best in the first objective comes first."""
    feasible = [one for one in tried if one.is_feasible]
    losses = losses_of(space, feasible)
    kept: dict[str, tuple[float, Tried]] = {}
    for one, loss, keep in zip(feasible, losses, not_dominated(losses), strict=True):
        if keep:
            kept.setdefault(one.digest, (float(loss[0]), one))
    return tuple(one for _, one in sorted(kept.values(), key=lambda item: (item[0], item[1].number)))


LEAST_DESIGNS = 20
"""Least number of designs: with fewer, the best tenth means nothing."""


def importances(space: SearchSpace, url: str) -> dict[str, dict[str, float]]:
    """Importance of each field as {objective: {path: share}}; the shares of an objective sum to 1.

    Empty if fewer than `LEAST_DESIGNS` designs were judged completely.
    """
    with opened_study(space, url) as study:
        if len(trials_in(study, TrialState.COMPLETE)) < LEAST_DESIGNS:
            return {}
        paths = [field.path for field in space.fields]
        return {
            objective.figure: _shares(study, paths, number)
            for number, objective in enumerate(space.objectives)
        }


def _shares(study: optuna.Study, paths: list[str], number: int) -> dict[str, float]:
    """Shares of an objective; the fields are named, because Optuna's own order changes with Python's hash seed."""
    sign = -1.0 if study.directions[number] == optuna.study.StudyDirection.MAXIMIZE else 1.0

    def loss(trial: FrozenTrial) -> float:
        return sign * float(trial.values[number])

    with warnings.catch_warnings():
        # Optuna warns about the sign, which `loss` handles, and about few designs, which the report mentions.
        for known in ("PedAnovaImportanceEvaluator computes", "Target and region quantiles"):
            warnings.filterwarnings("ignore", message=known, category=UserWarning)
        evaluator = PedAnovaImportanceEvaluator()
        found = optuna.importance.get_param_importances(study, evaluator=evaluator, params=paths, target=loss)
    return {name: float(share) for name, share in found.items()}
