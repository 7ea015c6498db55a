"""Building HTML safely: text becomes markup in one place only, and is escaped there.

`element` escapes every child that is not `Html` already, so whatever a design file says stays text.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

VOID = frozenset({"img", "br", "input"})


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def element(tag: str, *children: str, **attributes: str | None) -> Html:
    """One element; plain text among its children is escaped.

    Parameters
    ----------
    attributes : values; None leaves one out; ``class_`` stands for class, ``aria_label`` for aria-label
    """
    inside = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
        if value is not None
    )
    if tag in VOID:
        return Html(f"<{tag}{inside}>")
    return Html(f"<{tag}{inside}>{joined(children)}</{tag}>")


def joined(parts: Iterable[str], between: str = "") -> Html:
    """Markup and text one after the other; text is escaped."""
    return Html(escape(between).join(part if isinstance(part, Html) else escape(part) for part in parts))


def bullets(items: Iterable[str], class_: str | None = None) -> Html:
    """An unordered list."""
    return element("ul", *(element("li", item) for item in items), class_=class_)


def radios(name: str, labels: Iterable[str]) -> list[Html]:
    """One radio button a label, with its number as value; the first is chosen."""
    return [
        element(
            "label",
            element("input", type="radio", name=name, value=str(number), checked="" if number == 0 else None),
            f" {label}",
        )
        for number, label in enumerate(labels)
    ]


def table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    label: str,
    numeric: Sequence[int] = (),
    class_: str | None = None,
) -> Html:
    """A table that scrolls sideways on a narrow page; the first cell of a row is its heading.

    Parameters
    ----------
    label : read out by a screen reader, and the name of the scrolling region
    numeric : columns that are aligned to the right and never broken
    """
    looks = ["number" if column in numeric else None for column in range(len(heads))]
    head = element(
        "tr",
        *(element("th", text, scope="col", class_=look) for text, look in zip(heads, looks, strict=True)),
    )
    body = [
        element(
            "tr",
            element("th", row[0], scope="row"),
            *(element("td", cell, class_=look) for cell, look in zip(row[1:], looks[1:], strict=True)),
        )
        for row in rows
    ]
    grid = element("table", element("thead", head), element("tbody", *body), class_=class_)
    return element("div", grid, class_="scroll", tabindex="0", role="region", aria_label=label)


def facts(rows: Iterable[tuple[str, str]]) -> Html:
    """Names and values in two columns."""
    pairs = (joined([element("dt", name), element("dd", value)]) for name, value in rows)
    return element("dl", *(element("div", pair) for pair in pairs))


def section(identifier: str, title: str, *children: str, class_: str | None = None) -> Html:
    """A part of the page with a heading that can be linked to."""
    heading = f"{identifier}-title"
    return element(
        "section",
        element("h2", title, id=heading),
        *children,
        id=identifier,
        aria_labelledby=heading,
        class_=class_,
    )
