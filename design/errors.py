"""The errors that a user can cause; each has one message and ends a command with exit code 2.

OptopadError
├── DesignError       a design or catalogue file: the message names field, value, limit and a remedy
├── InputError        an argument of a command or call
├── OutputError       a file or folder that cannot be written
├── ModelScopeError   a request outside the range of the physics models
└── DeviceError       the sensor or its serial line: missing, another device, no response, or wrong wiring
"""

LONGEST_LINE = 900
"""Longest line of a message [characters], about ten lines on a screen.

With 4 bytes per character a line stays below `LONGEST_MESSAGE_BYTES`.
"""
LONGEST_MESSAGE_BYTES = 3_800
"""Longest message in UTF-8 [bytes]; many logs limit a line to 4 kB, including the command's name."""
_CUT = " ... "
_MORE = "  ... and {} more lines"


def readable(message: str) -> str:
    """A message in printable form: without control characters, and shortened if it is too long.

    Messages quote files and arguments, which may contain any characters. Long lines keep their start and end, which
    name the field and the remedy.
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
    """Base class of every error with a message for the user, which `readable` makes printable."""

    def __init__(self, message: object = "") -> None:
        super().__init__(readable(str(message)))


class DesignError(OptopadError):
    """A design or catalogue file cannot be used in its present form."""


class InputError(OptopadError):
    """An argument of a command or a call is not valid."""


class OutputError(OptopadError):
    """A file or folder cannot be written; its previous content is unchanged."""


class ModelScopeError(OptopadError):
    """The request is outside the range of the physics models, which do not extrapolate."""


class DeviceError(OptopadError):
    """The sensor or its serial line does not respond as required; data recorded so far are kept."""


SHOWN_CHARACTERS = 60


def shown(value: object) -> str:
    """A value as text for an error message; long values are shortened."""
    text = repr(value)
    return text if len(text) <= SHOWN_CHARACTERS else text[: SHOWN_CHARACTERS - 3] + "..."
