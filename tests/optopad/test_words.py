"""No help, message, report, drawing, generated file or comment in them has a word of the list."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import click
import pytest

from optopad.cli.commands import whole_command
from tests.optopad.plain_words import READERS, texts_of, words_of

LEAST_TEXTS = 7000
"""The product has a few more; far fewer mean that the reader has lost some."""


def commands_in(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    yield name, command
    for inner in getattr(command, "commands", {}).values():
        yield from commands_in(inner, f"{name} {inner.name}")


HELP = dict(commands_in(whole_command(), "optopad"))


def test_no_text_of_the_product_has_a_word_of_the_list():
    texts = list(texts_of())
    assert len(texts) > LEAST_TEXTS
    assert {file[file.rindex(".") :] for file, _ in texts} == set(READERS)
    assert [(file, found, text) for file, text in texts if (found := words_of(text))] == []


@pytest.mark.parametrize("name", HELP)
def test_no_help_has_a_word_of_the_list(name):
    said = HELP[name].get_help(click.Context(HELP[name], info_name=name, **HELP[name].context_settings))
    assert said.startswith("Usage: optopad")
    assert words_of(said) == []


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a frame tells depth", ["tells"]),
        ("the weakest place is blind", ["weakest", "place", "blind"]),
        ("surfaces.wall_reflectance is told", ["told"]),
        ("part_measurements.blind-led.width_mm changes the verdict", []),
        ("{file}: 'place' is missing; see `optopad told`, --builds or random_places", []),
        ("12 of 200 builds are spent; measured on the build", ["builds", "spent", "the build"]),
    ],
)
def test_a_word_of_the_list_is_seen(text, found):
    assert words_of(text) == found
