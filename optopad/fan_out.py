"""Scores the designs of a search on a Dask cluster: designs are sent in batches, and results return in any order.

The user provides the cluster: scheduler and workers with the same version of optopad. If a worker dies, the scheduler
gives its designs to another worker. The light model uses all processors of a worker, so each worker should have one
thread (`dask worker --nthreads 1`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from optopad.design.errors import InputError, OptopadError
from optopad.design.search.improve import FanOut, Judged, Limit, Objective
from optopad.design.spec import SensorDesign

CONNECT_TIMEOUT_S = 10


@contextmanager
def on_cluster(address: str) -> Iterator[FanOut]:
    """Yield a function that scores designs on the workers of a scheduler, whose address may be tcp://127.0.0.1:8786.

    Raises
    ------
    InputError : the package `distributed` is missing, no scheduler replies, the scheduler has no workers, or the
        connection is lost.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler: needs the package distributed; install it (pip install distributed), or leave it out"
        ) from None
    try:
        client: Any = Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TimeoutError) as err:
        reason = str(err).splitlines()[0] if str(err) else type(err).__name__
        raise InputError(
            f"--scheduler: no scheduler replies at {address!r}: {reason}; start one with `dask scheduler`"
        ) from None
    with client:
        if not client.scheduler_info()["workers"]:
            raise InputError(
                f"--scheduler: {address} has no workers; start some with `dask worker {address} --nthreads 1`"
            )
        yield _fan_out(client, address)


def _fan_out(client: Any, address: str) -> FanOut:
    from distributed import CancelledError, KilledWorker, as_completed

    def fan_out(
        objective: Objective, designs: Sequence[SensorDesign], limits: tuple[Limit, ...]
    ) -> Iterable[tuple[int, Judged]]:
        sent = {
            client.submit(objective, design, limits, pure=False): number
            for number, design in enumerate(designs)
        }
        try:
            for future in as_completed(list(sent), loop=client.loop):  # type: ignore[no-untyped-call]
                yield sent[future], future.result()
        except OptopadError:
            raise
        except KilledWorker as err:
            raise InputError(
                f"--scheduler: workers of {address} crash on one design ({err.last_worker}); see their "
                "logs: memory is the usual cause (finished designs are kept)"
            ) from None
        except (CancelledError, OSError, TimeoutError) as err:
            raise InputError(
                f"--scheduler: {address} was lost: {err or type(err).__name__}; finished designs are "
                "kept: start it again and repeat the command"
            ) from None

    return fan_out
