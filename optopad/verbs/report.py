"""Finds the report of a bundle, and checks the bundle's files."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from optopad.cli.verb import typed, verb
from optopad.design.errors import InputError
from optopad.fabrication.bundle import MANIFEST, altered_files, with_other_line_ends
from optopad.screen.output import Told


@verb(bundle=typed("BUNDLE"))
def report(bundle: Path, *, open_: bool = False) -> Told:
    """Check every file of a bundle against its manifest and show the path of the report.

    Parameters
    ----------
    bundle : Bundle folder of an earlier run.
    open_ : Open it in the browser.
    """
    page = bundle / "report.html"
    if not (bundle / MANIFEST).is_file() or not page.is_file():
        raise InputError(f"{bundle}: no bundle with a report; make one with `optopad run DESIGN`")
    altered = altered_files(bundle)
    rewrapped = with_other_line_ends(bundle, altered)
    lines = [f"report    {page}"]
    if rewrapped:
        lines.append(
            f"warning   {len(rewrapped)} files have other line ends than the run wrote, and the same content: git "
            "(core.autocrlf) or a copy by Windows changed them; put `* -text` into .gitattributes and check out "
            "again, or copy the folder as it is"
        )
    for name in sorted(set(altered).difference(rewrapped)):
        lines.append(f"warning   {name} differs from the manifest: it was changed after the run")
    if open_:
        webbrowser.open(page.resolve().as_uri())
    return Told({"report": str(page), "altered": list(altered), "line_ends": list(rewrapped)}, lines)
