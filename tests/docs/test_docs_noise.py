"""The page on data sets names every parameter of the noise model with its default."""

import json
import re
from pathlib import Path

from optopad.design.spec.sensor import Noise

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "simulate-data-set.md"


def test_every_parameter_stands_in_the_table_with_its_default() -> None:
    text = PAGE.read_text(encoding="utf-8")
    table = text[text.index("| `noise.` |") : text.index('"Bounded" means')]
    rows = dict(re.findall(r"^\| `(\w+)` \| (\S+) \|", table, flags=re.MULTILINE))
    said = {name: None if value == "none" else json.loads(value) for name, value in rows.items()}
    assert said == {name: getattr(Noise(), name) for name in Noise.model_fields}
