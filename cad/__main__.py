"""``python -m optopad.cad DESIGN FOLDER`` exports a design's parts as files, in a separate process.

The pipeline runs this command while the physics is computed. The process must be a fresh interpreter, not a fork,
because the CAD kernel does not survive a fork. It also makes the export independent of the caller's main module.
"""

from __future__ import annotations

import sys
from pathlib import Path

from optopad.cad.export import export_parts
from optopad.design.errors import OptopadError
from optopad.design.io import load_design


def main(design_file: str, folder: str) -> int:
    """Export a design's parts; return 0 on success, or 2 if that fails, with a message on standard error."""
    try:
        export_parts(load_design(design_file), Path(folder))
    except OptopadError as err:
        print(err, file=sys.stderr)
        return 2
    except OSError as err:
        print(f"{folder}: cannot be written: {err.strerror or err}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
