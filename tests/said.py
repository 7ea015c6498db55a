"""What matters in a message: a field, a value, a limit, a name. The words between them are free.

The whole messages are in `tests/messages.txt`.
"""

from __future__ import annotations

import re


def pattern(pieces: str) -> str:
    """A regular expression for pieces in their order, with " ... " between two of them."""
    return "(?s)" + ".*?".join(map(re.escape, pieces.split(" ... ")))


def says(message: str, pieces: str) -> bool:
    """Whether a message has the pieces in their order."""
    return re.search(pattern(pieces), message) is not None
