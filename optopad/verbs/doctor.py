"""Reports what this machine can do, and which packages are missing."""

from __future__ import annotations

from dataclasses import asdict

from optopad import doctor as machine
from optopad.cli.verb import verb
from optopad.screen.output import Told


@verb()
def doctor() -> Told:
    """Report what this machine can and cannot do."""
    findings = machine.examine()
    lines = [
        f"{one.state:<8} {one.name:<16} {one.detail}" + (f"  -> {one.way_out}" if one.way_out else "")
        for one in findings
    ]
    return Told({"findings": [asdict(one) for one in findings]}, lines)
