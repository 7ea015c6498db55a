"""The errors that a user can cause; each carries one message and ends a command with exit code 2.

OptopadError
├── DesignError       a design or catalogue file: the field, its value, the limit, the way out
├── InputError        an argument of a command or call
├── OutputError       a file or folder that cannot be written
├── ModelScopeError   a question outside what the physics models cover
└── DeviceError       the built sensor or its serial line: not there, not ours, silent, or wired wrong
"""

LONGEST_LINE = 900
"""Longest line of a message [characters]: a screen holds about ten; 4 bytes each stay below the next limit."""
LONGEST_MESSAGE_BYTES = 3_800
"""Longest message in UTF-8: a screen or a line of a log holds 4 kB, less room for the command's name."""
_CUT = " ... "
_MORE = "  ... and {} more lines"


def readable(message: str) -> str:
    """A message in printable form: no control characters but line feeds, long lines cut, surplus lines counted.

    Messages quote files and arguments, which may contain anything. The start and end of a line are kept, because they
    name the field and the way out.
    """
    lines = [_cut(_printable(_cut(line))) for line in message.split("\n")]
    if len("\n".join(lines).encode()) <= LONGEST_MESSAGE_BYTES:
        return "\n".join(lines)
    kept, room = 0, LONGEST_MESSAGE_BYTES - len(_MORE.encode()) - 10
    while (room := room - len(lines[kept].encode()) - 1) >= 0:
        kept += 1
    return "\n".join([*lines[:kept], _MORE.format(len(lines) - kept)])


def _printable(line: str) -> str:
    if line.isprintable():
        return line
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in line)


def _cut(line: str) -> str:
    if len(line) <= LONGEST_LINE:
        return line
    end = (LONGEST_LINE - len(_CUT)) // 3
    return line[: LONGEST_LINE - len(_CUT) - end] + _CUT + line[-end:]


class OptopadError(Exception):
    """Base of every error with a message for the user; the message is made readable whatever it quotes."""

    def __init__(self, message: object = "") -> None:
        super().__init__(readable(str(message)))


class DesignError(OptopadError):
    """A design or catalogue file cannot be used in its present form."""


class InputError(OptopadError):
    """An argument of a command or a call cannot be used."""


class OutputError(OptopadError):
    """A file or folder cannot be written; its previous content is intact."""


class ModelScopeError(OptopadError):
    """The physics models do not cover the request; nothing is extrapolated."""


class DeviceError(OptopadError):
    """The manufactured unit, or the line to it, does not respond as required; nothing recorded so far is lost."""


SHOWN_CHARACTERS = 60


def shown(value: object) -> str:
    """A value in the form for messages: long values are shortened."""
    text = repr(value)
    return text if len(text) <= SHOWN_CHARACTERS else text[: SHOWN_CHARACTERS - 3] + "..."
