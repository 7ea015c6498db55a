"""The errors that a user can cause; each carries one message and ends a command with exit code 2.

OptopadError
├── DesignError       a design or catalogue file: the field, its value, the limit, the way out
├── InputError        an argument of a command or call
├── OutputError       a file or folder that cannot be written
├── ModelScopeError   a question outside what the physics models cover
└── DeviceError       the built sensor or its serial line: not there, not ours, silent, or wired wrong
"""


class OptopadError(Exception):
    """Base of every error whose message is meant for the user."""


class DesignError(OptopadError):
    """A design or catalogue file cannot be used as it stands."""


class InputError(OptopadError):
    """An argument of a command or a call cannot be used."""


class OutputError(OptopadError):
    """A file or folder cannot be written; what was there before is intact."""


class ModelScopeError(OptopadError):
    """The physics models do not cover what was asked; nothing is extrapolated."""


class DeviceError(OptopadError):
    """The built sensor, or the line to it, does not do what was asked; nothing recorded so far is lost."""


SHOWN_CHARACTERS = 60


def shown(value: object) -> str:
    """A value as a message shows it: shortened where it is long."""
    text = repr(value)
    return text if len(text) <= SHOWN_CHARACTERS else text[: SHOWN_CHARACTERS - 3] + "..."
