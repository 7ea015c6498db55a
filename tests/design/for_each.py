"""One test over many small cases: a thousand tests of a millisecond cost more in being found than in being run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest

LONGEST_NAME = 100


def for_each(cases: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[[], None]]:
    """Make a test of a function that takes a case; all cases are tried, and those that fail are named.

    Parameters
    ----------
    cases : one argument each, or a tuple of arguments
    """
    kept = [case if isinstance(case, tuple) else (case,) for case in cases]
    assert kept

    def over(require: Callable[..., None]) -> Callable[[], None]:
        def test() -> None:
            failed = []
            for case in kept:
                try:
                    require(*case)
                except (Exception, pytest.fail.Exception) as err:
                    failed.append(f"{name_of(case)}: {type(err).__name__}: {err}")
            assert not failed, f"{len(failed)} of {len(kept)} cases failed\n" + "\n".join(failed)

        test.__name__, test.__doc__, test.__module__ = require.__name__, require.__doc__, require.__module__
        return test

    return over


def name_of(case: tuple[Any, ...]) -> str:
    """A case in a few words: the paths of fields, and what else it holds as text."""
    return ", ".join(str(getattr(one, "path", one))[:LONGEST_NAME] for one in case)
