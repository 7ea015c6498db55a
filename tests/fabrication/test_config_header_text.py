"""Texts of a design inside the firmware's C: they end no comment and no string."""

import pytest

from optopad.fabrication.sketch import plain


@pytest.mark.parametrize(
    "text", ["**// \nint injected;", 'x"\n#endif\nint injected;', "A0 */ }; int injected;", "trigraph ??/"]
)
def test_a_text_ends_neither_comment_nor_string_nor_line(text):
    found = plain(text)
    assert not set(found) & set('*/"\\\n\r?;#{}')
    assert len(found) == len(text)


def test_names_of_boards_and_inputs_stay_as_they_are():
    for text in ("Arduino Mega 2560", "arduino:avr:mega", "A15", "Nano (ATmega328)"):
        assert plain(text) == text
