"""Every verb of the command line as Markdown: help, arguments, options with their defaults and limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

HIDDEN_OPTIONS = frozenset({"--help", "--install-completion", "--show-completion"})


def every_verb() -> str:
    """Markdown with a heading for every verb, groups after the verb that they stand with."""
    return "\n".join(line for name, command in verbs() for line in _verb_lines(name, command))


def verbs() -> Iterator[tuple[str, Any]]:
    """Name as typed behind `optopad`, and command, of every verb; a group is followed by its own verbs."""
    from optopad.cli.commands import whole_command

    yield from _below("", whole_command())


def _below(prefix: str, group: Any) -> Iterator[tuple[str, Any]]:
    for name, command in group.commands.items():
        if command.hidden:
            continue
        if hasattr(command, "commands"):
            yield from _below(f"{prefix}{name} ", command)
        else:
            yield f"{prefix}{name}", command


def _verb_lines(name: str, command: Any) -> list[str]:
    arguments = [one for one in command.params if one.param_type_name == "argument"]
    options = [one for one in command.params if one.param_type_name == "option" and not _is_hidden(one)]
    usage = " ".join(["optopad", name, *map(_usage_of, arguments), *(["[OPTIONS]"] if options else [])])
    lines = [f"## optopad {name}", "", _text(command.help), "", "```text", usage, "```", ""]
    if arguments:
        lines += [
            "| argument | meaning |",
            "|---|---|",
            *(_row(_usage_of(one), one) for one in arguments),
            "",
        ]
    if options:
        lines += ["| option | meaning | default |", "|---|---|---|"]
        lines += [_row(_option_name(one), one, _default_of(one)) for one in options] + [""]
    return lines


def _is_hidden(option: Any) -> bool:
    return option.hidden or bool(HIDDEN_OPTIONS & set(option.opts))


def _usage_of(argument: Any) -> str:
    name = (argument.metavar or argument.name or "").upper() + ("..." if argument.nargs == -1 else "")
    name = name.replace("......", "...").strip("[]")
    return name if argument.required else f"[{name}]"


def _option_name(option: Any) -> str:
    names = [*sorted(option.opts, key=len), *option.secondary_opts]
    value = "" if option.is_flag or option.count else f" {_metavar(option)}"
    return ", ".join(names) + value


def _metavar(option: Any) -> str:
    return option.metavar or getattr(option.type_descriptor.annotation, "__name__", "value").upper()


def _row(name: str, parameter: Any, *more: str) -> str:
    about = _text(parameter.help) + _limits(parameter)
    return " | ".join([f"| `{_cell(name)}`", _cell(about), *more]) + " |"


def _limits(parameter: Any) -> str:
    low, high = parameter.min, parameter.max
    if low is None and high is None:
        return ""
    if high is None:
        return f" At least {low}."
    return f" At most {high}." if low is None else f" {low} to {high}."


def _default_of(option: Any) -> str:
    if option.required:
        return "needed"
    if option.is_flag:
        return "on" if option.default else "off"
    if option.default is None or option.default in ((), []):
        return ""
    default = option.default
    if callable(default):
        default = default()
    if isinstance(default, list | tuple):
        default = ", ".join(map(str, default))
    return f"`{_cell(str(getattr(default, 'value', default)))}`"


def _text(text: str | None) -> str:
    """Help as one paragraph; what would be read as markup is set as it is."""
    return " ".join((text or "").replace("\b", "").split()).replace("<", "\\<").replace("*", "\\*")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
