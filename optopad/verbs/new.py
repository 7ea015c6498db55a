"""Writes a design file to start from."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from optopad.cli.verb import typed, verb
from optopad.design.errors import InputError
from optopad.design.fields.base import NAME_PATTERN
from optopad.design.files import require_suffix
from optopad.design.io import write_text_atomically
from optopad.design.preset import PRESETS, new_text
from optopad.design.spec import SensorDesign
from optopad.screen.output import Told


@verb(file=typed("FILE"), preset=typed(help=f"{', '.join(PRESETS[:-1])} or {PRESETS[-1]}."))
def new(file: Path, *, preset: str = "piacenza2017-pad", force: bool = False) -> Told:
    """Write a commented design file to start from.

    Parameters
    ----------
    file : Design file to write.
    force : Replace an existing file.
    """
    require_suffix(file, (".toml",))
    if not re.fullmatch(NAME_PATTERN, file.stem):
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", file.stem).strip("._-")[:63] or "my-pad"
        raise InputError(
            f"{file}: a design is named after its file, in plain letters, digits, dots, dashes and "
            f"underscores, 63 at most; use {file.with_name(plain + '.toml')}"
        )
    if file.exists() and not force:
        raise InputError(f"{file}: exists already; choose another name, or --force to replace it")
    text = new_text(file.stem, preset)
    design = SensorDesign.from_document(tomllib.loads(text), where=str(file))
    write_text_atomically(file, text)
    return Told(
        {"file": str(file), "preset": preset, "digest": design.digest},
        [f"{file} written from {preset}. Next: optopad check {file}, then optopad run {file}"],
    )
