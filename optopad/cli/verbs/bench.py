"""The verb doctor."""

from __future__ import annotations

from optopad.cli import options
from optopad.cli.output import print_json, say


def doctor(as_json: options.Json = False) -> None:
    """What this machine can and cannot do."""
    from dataclasses import asdict

    from optopad.doctor import examine

    findings = examine()
    if as_json:
        print_json({"findings": [asdict(finding) for finding in findings]})
    else:
        for finding in findings:
            way_out = f"  -> {finding.way_out}" if finding.way_out else ""
            say(f"{finding.state:<8} {finding.name:<16} {finding.detail}{way_out}")
