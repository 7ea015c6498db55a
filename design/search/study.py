"""The study behind a search: where its designs are kept, which sampler proposes them, and who may join.

A study lives in a database that Optuna manages: SQLite in the search's folder, or any that its address names (many
processes may then work on one study). It carries the digest of its search space and refuses another one. A design that
a killed process left unfinished is proposed again, with the same values.
"""

from __future__ import annotations

import hashlib
import importlib.util
import itertools
import math
import os
import socket
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import optuna
import sqlalchemy
from optuna.distributions import BaseDistribution, CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.samplers import BaseSampler
from optuna.storages import RDBStorage
from optuna.trial import FrozenTrial, TrialState

from design.errors import DesignError, InputError
from design.search.space import SearchSpace, SpaceField, Value

DIGEST, SPACE, MAKER, QUEUED = "space_digest", "space", "maker", "queued"
CONNECT_TIMEOUT_S = 10
LOCK_TIMEOUT_S = 120
CREATE_ATTEMPTS = 8
GRACE_BEATS = 3
"""Heartbeats that a worker may miss before its designs are given to others."""
MAX_GRID = 100_000
POPULATION = 32
"""Designs of a generation of NSGA-II: with a few hundred designs in all, half of Optuna's 50 generations count more."""
QUEUE_PATIENCE_S = 30
"""How long a worker waits for another one to queue what a study begins with [s]."""
FINISHED = (TrialState.COMPLETE, TrialState.PRUNED)


@contextmanager
def opened_study(space: SearchSpace, url: str, *, heartbeat_s: int | None = None) -> Iterator[optuna.Study]:
    """The study of a space, made when missing; connections are closed at the end.

    Parameters
    ----------
    url : address of the database, as sqlite:///folder/study.db or postgresql://user@host/name
    heartbeat_s : period in which a worker of a shared study shows that it lives [s]; None: nobody else works on it

    Raises
    ------
    InputError : the storage cannot be reached, or holds a study of this name of another space.
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
            f"{str(known)[:8]}, this one is {space.digest[:8]}); name the space anew, or restore the old one"
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
    """Turn a database's own errors into one message for the user."""
    try:
        yield
    except (sqlalchemy.exc.SQLAlchemyError, optuna.exceptions.StorageInternalError, ImportError) as err:
        root: BaseException = err.__cause__ or err
        reason = str(getattr(root, "orig", None) or root).strip().splitlines()[0]
        raise InputError(
            f"--storage: {shown_url(url)} cannot be reached: {reason}; check address, server and rights "
            "(finished designs are kept; the same command goes on)"
        ) from err


def shown_url(url: str) -> str:
    """The address without its password."""
    try:
        return sqlalchemy.engine.make_url(url).render_as_string(hide_password=True)
    except sqlalchemy.exc.ArgumentError:
        return repr(url)


def _storage_with_tables(url: str, heartbeat_s: int | None) -> RDBStorage:
    """The storage; of workers that make its tables at once all but one fail, and find them on the next attempt."""
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
        # Heartbeats are marked experimental since 2.9 and unchanged since; the beat itself is `beating` of explore.
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
        storage.engine.dispose()  # connections from before are without it
    return storage


def _write_ahead(connection: Any, _: Any) -> None:
    """Have SQLite write ahead: a killed process loses nothing, at a tenth of the time a commit takes.

    A power cut may lose the last seconds, and never harms what was there before.
    """
    for pragma in ("journal_mode=WAL", "synchronous=NORMAL"):
        connection.execute(f"PRAGMA {pragma}")


def distributions_of(space: SearchSpace) -> dict[str, BaseDistribution]:
    """The fields as Optuna names them; choices by their labels."""
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
    """Refuse a sampler whose library is missing, and a grid too large to be meant.

    Raises
    ------
    InputError, DesignError : which, and the way out.
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
    """Points of the whole grid."""
    return math.prod(len(space.values_of(field) or ()) for field in space.fields)


def sampler_of(space: SearchSpace, index: int, worker: str) -> BaseSampler:
    """The sampler of one proposal, seeded by its position so that a resumed search goes on as it would have.

    Parameters
    ----------
    index : how many designs were proposed before
    worker : empty for a search of one process; tells the workers of a shared study apart
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
            case _:  # the grid is queued beforehand, so nothing is left to sample
                return optuna.samplers.RandomSampler(seed=seed)


def queue_first(
    study: optuna.Study, space: SearchSpace, *, is_shared: bool, first: Sequence[dict[str, Value]] = ()
) -> None:
    """Queue what a search begins with, once a study: every point of a grid, else the base design where it lies inside.

    Points of `first` follow the base design.

    Of workers that begin together one makes the study and does it; the others wait for it, unless it dies over it.
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
    """Propose again what killed processes left unfinished: everything, or in a shared study what no longer beats."""
    if is_shared:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            optuna.storages.fail_stale_trials(study)
    else:
        release(study, [trial.number for trial in trials_in(study, TrialState.RUNNING)])


def beat(study: optuna.Study, trial_ids: Sequence[int]) -> None:
    """Record that designs of a shared study are in hand, as Optuna's own loop does; nothing public does it."""
    storage: Any = study._storage
    for trial_id in trial_ids:
        getattr(storage, "_backend", storage).record_heartbeat(trial_id)


def release(study: optuna.Study, numbers: Sequence[int]) -> None:
    """Take designs back that were proposed and not judged, and queue them again."""
    for number in numbers:
        trial = next(one for one in study.get_trials(deepcopy=False) if one.number == number)
        if not trial.state.is_finished():
            study.tell(number, state=TrialState.FAIL)
            _propose_again(study, trial)


def trials_in(study: optuna.Study, *states: TrialState) -> list[FrozenTrial]:
    """Trials in these states, by number."""
    return study.get_trials(deepcopy=False, states=states)


def _propose_again(study: optuna.Study, trial: FrozenTrial) -> None:
    """Queue a lost trial's values; one that was lost before it had all of them is drawn anew."""
    point = trial.system_attrs.get("fixed_params") or trial.params
    wanted = {field["path"] for field in study.user_attrs[SPACE]["fields"]}
    if set(point) == wanted:
        study.enqueue_trial(point)


def _point(trial: FrozenTrial) -> tuple[tuple[str, Value], ...]:
    found: dict[str, Any] = trial.system_attrs.get("fixed_params") or trial.params
    return tuple(sorted(found.items()))
