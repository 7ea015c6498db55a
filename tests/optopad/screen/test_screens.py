"""Screens of real designs: short, in the design file's own names, and every number with its unit.

python -m tests.optopad.screen.test_screens    all presets and cases, printed and held to the rules: ten minutes
"""

from __future__ import annotations

import re

import pytest

from design.fields.base import get_at
from design.preset import preset
from design.spec import SensorDesign
from design.spec.properties import used_values
from optopad.screen.verdict import LINES, WIDTH, verdict_screen
from sims.score.scoring import score

CASES = {
    "pair": ("piacenza2017-pair", {}),
    "pair at 10 mm": ("piacenza2017-pair", {"cavity.clear_thickness_mm": 10.0}),
    "pair at 12 mm": ("piacenza2017-pair", {"cavity.clear_thickness_mm": 12.0}),
    "fingertip": ("fingertip-16", {}),
    "pad": ("piacenza2017-pad", {}),
    "oblong": ("oblong-60x40", {}),
    "pad at 11 mm": ("piacenza2017-pad", {"cavity.clear_thickness_mm": 11.0}),
    "pad, receivers at 7 mm": ("piacenza2017-pad", {"receivers.height_mm": 7.0}),
    "oblong, LEDs at 3 mm": ("oblong-60x40", {"emitters.height_mm": 3.0}),
}
NUMBER = r"\d+(?:\.\d+)?(?:e-?\d+)?"
UNIT = r"(?:mm|noise units|sigma|N|%|counts|dB/cm|mW|nm|MPa|°|minutes|s)\b|[%°]"
NOUN = (
    r"(?:of \d+ )?(?:more |other |unmeasured )*(?:pairs?|locations?|parameters?|moves?|warnings?|errors?)\b"
)
FIELD = re.compile(r"(?<![\w/.-])[a-z_]+(?:\.[a-z0-9_-]+)+")
FILE = re.compile(r"\.(?:toml|html|md|stl|json|3mf)$")


def without_units(line: str) -> list[str]:
    """Numbers of a line that neither a unit nor a noun follows, names of parts, modes and fields left out.

    Locations and ranges have their unit at the end: "(16, 16) mm", "3.10 to 3.40 mm".
    """
    text = re.sub(r"(?<![\w/.-])[a-z_]+(?:\.[a-z0-9_-]+)+", "field", line)
    text = re.sub(r"\b[ER]\d+(?:-R\d+)?\b|\bmode [12]\b", "name", text)
    found = []
    for match in re.finditer(NUMBER, text):
        after = text[match.end() :]
        ends = rf"(?:[^\w;.]*(?:to|and|of the|where)?\s*{NUMBER})+\)?\s*(?:{UNIT})"
        if not re.match(rf"\)?\s*(?:{UNIT}|{NOUN})", after) and not re.match(ends, after):
            found.append(match[0])
    return found


def unknown_fields(line: str, design: SensorDesign) -> list[str]:
    """Names with dots that are neither a field of the design, nor a value behind it, nor a file."""
    known = {used.path for used in used_values(design)}
    found = []
    for name in FIELD.findall(line):
        if name in known or FILE.search(name):
            continue
        try:
            get_at(design.model_dump(mode="json"), name)
        except (KeyError, IndexError, TypeError, ValueError):
            found.append(name)
    return found


def looked_at(name: str, changes: dict[str, float]) -> None:
    design = preset(name).with_(**changes)
    screen = verdict_screen(design, score(design), ["report      outputs/x/report.html"], command="pad.toml")
    print("\n".join(screen))
    assert len(screen) <= LINES
    assert max(map(len, screen)) <= WIDTH
    said = [line for line in screen if not line.startswith(("design", "next", "report"))]
    whole = " ".join(line[12:] for line in said)
    assert unknown_fields(whole, design) == []
    assert without_units(whole) == []


@pytest.mark.slow
def test_the_screen_of_a_pair_with_a_deadband():
    looked_at(*CASES["pair at 10 mm"])


@pytest.mark.full
def test_the_screen_of_a_pad_with_a_deadband():
    looked_at(*CASES["pad at 11 mm"])


@pytest.mark.parametrize(
    ("line", "bare"),
    [
        ("3.10 to 3.40 mm at (16, 16) mm", []),
        ("5.9 sigma at (11, 16) mm; a deadband is below 3", ["3"]),
        ("5.9 sigma at (11, 16) mm, 4.6 to 4.9 mm deep; a deadband is below 3 sigma", []),
        ("at (11, 16), 4.6 mm deep", []),
        ("none of the 9 unmeasured parameters changes the verdict", []),
        ("none of the 9 changes the verdict", ["9"]),
        ("parts too low by 3.9", ["3.9"]),
        ("taken by E7-R2 (part_measurements.sunled-2.width_mm)", []),
    ],
)
def test_a_number_without_a_unit_is_seen(line, bare):
    assert without_units(line) == bare


if __name__ == "__main__":
    for name, changes in CASES.values():
        looked_at(name, changes)
        print()
