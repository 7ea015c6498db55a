"""Numbers as the page writes them: depths to the hundredth of a millimetre, open ends as words."""

from __future__ import annotations

from collections.abc import Iterable

DASH = "\N{EN DASH}"
Interval = tuple[float, float]


def depth(value_mm: float | None, absent: str = "open") -> str:
    """A depth without its unit."""
    return absent if value_mm is None else f"{value_mm:.2f}"


def signed(value_mm: float | None, absent: str = "open") -> str:
    """A mode gap without its unit, always with its sign."""
    return absent if value_mm is None else f"{value_mm:+.2f}".replace("-", "\N{MINUS SIGN}")


def spans(intervals_mm: Iterable[Interval], absent: str = "none", between: str = " to ") -> str:
    """Depth intervals without their unit."""
    return ", ".join(f"{start:.2f}{between}{end:.2f}" for start, end in intervals_mm) or absent


def ends(low: float, high: float) -> str:
    """Both ends of a band."""
    return f"{low:.3g} to {high:.3g}"


def counted(count: int, one: str, many: str | None = None) -> str:
    """A number with its noun."""
    return f"{count} {one if count == 1 else many or one + 's'}"
