"""Writes the JSON Schema of design files."""

from __future__ import annotations

import json
from pathlib import Path

from optopad.cli.verb import file_name, typed, verb
from optopad.design.io import file_schema, write_text_atomically


@verb(out=typed("FILE", callback=file_name(".json")), as_json=None)
def schema(*, out: Path | None = None) -> None:
    """Print the JSON Schema of design files, for completion and checks in an editor.

    Parameters
    ----------
    out : File to write (.json); default: standard output.
    """
    text = json.dumps(file_schema(), indent=2)
    if out is None:
        print(text)
    else:
        write_text_atomically(out, text + "\n")
        print(f'{out} written. In a design file: "#:schema {out}" as the first line')
