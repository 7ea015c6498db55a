"""The words of a verdict, the same wherever one is shown: never a bare verdict where more has to be said."""

from __future__ import annotations

NEGLIGIBLE_MM = 5e-4
"""Usable depths this near to the depth asked for are that depth: plain data is rounded [mm]."""


def headline(
    verdict: str,
    *,
    is_open: bool,
    usable_mm: float | None,
    asked_mm: float | None,
    is_short: bool = False,
) -> str:
    """The verdict, whether it is undecided, and the usable depth where the design asks for more.

    Parameters
    ----------
    is_open : whether the numerical error of the light model leaves the verdict undecided
    usable_mm, asked_mm : usable depth, and deepest press of the design; None where nothing was judged [mm]
    is_short : for the column of a table
    """
    words = f"{verdict}, undecided" if is_open else verdict
    if usable_mm is None or asked_mm is None or usable_mm > asked_mm - NEGLIGIBLE_MM:
        return words
    joint = " to" if words == "CONTIGUOUS" else ", to" if is_open else ", usable to"
    asked = f"{asked_mm:g} mm" if is_short else f"the {asked_mm:g} mm asked"
    return f"{words}{joint} {_depth(usable_mm, asked_mm)} of {asked}"


def _depth(usable_mm: float, asked_mm: float) -> str:
    """To a tenth, or as many digits as tell it from the depth asked for."""
    digits = next(n for n in (1, 2, 3) if n == 3 or round(usable_mm, n) < asked_mm - NEGLIGIBLE_MM)
    return f"{usable_mm:.{digits}f}"
