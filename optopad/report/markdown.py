"""The build sheet as HTML, for the page. Links, images, HTML and emphasis of the Markdown text stay plain text."""

from __future__ import annotations

import re
from itertools import pairwise

from markdown_it import MarkdownIt
from markdown_it.tree import SyntaxTreeNode
from markupsafe import Markup

from optopad.fabrication.sheets.template import filled

DEEPEST_HEADING = 4
NUMBER = re.compile(r"-?[\d.]+\*?")
RULES = ("heading", "list", "table", "fence", "backticks", "escape", "entity", "newline")
_PARSER = MarkdownIt("zero").enable(RULES)


def html_of(text: str) -> Markup:
    """A Markdown sheet as HTML, without its title; second-level headings become third-level ones, and so on."""
    blocks = SyntaxTreeNode(_PARSER.parse(text)).children
    return Markup("\n").join(_block(one) for one in blocks if one.tag != "h1")


def _block(one: SyntaxTreeNode) -> Markup:
    if one.type == "table":
        return _table(one)
    if one.type == "fence":
        return Markup('<pre tabindex="0"><code>{}</code></pre>').format(one.content.rstrip("\n"))
    return _rendered(one)


def _rendered(one: SyntaxTreeNode) -> Markup:
    """Text as HTML; what follows a full stop or a colon at the end of a line starts a new paragraph."""
    tokens = one.to_tokens()
    for token in tokens:
        if token.type.startswith("heading"):
            token.tag = f"h{min(int(token.tag[1:]) + 1, DEEPEST_HEADING)}"
        for before, child in pairwise(token.children or []):
            if one.type == "paragraph" and child.type == "softbreak" and before.content.endswith((".", ":")):
                child.type, child.content = "html_inline", "</p>\n<p>"
    return Markup(_PARSER.renderer.render(tokens, _PARSER.options, {}))


def _table(one: SyntaxTreeNode) -> Markup:
    heads, *rows = [
        [cell.children[0] for cell in row.children] for part in one.children for row in part.children
    ]
    numeric = [
        column
        for column in range(1, len(heads))
        if all(NUMBER.fullmatch(row[column].content) for row in rows)
    ]
    shown = [[_rendered(cell) for cell in row] for row in (heads, *rows)]
    values = {"heads": shown[0], "rows": shown[1:], "numeric": numeric}
    return Markup(filled("optopad.report", "sheet_table.html.j2", values))
