"""Checks a design against the design rules: whether the pad can be made, and its verdict computed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from optopad.cli.verb import Asked, verb
from optopad.design.draft import Draft
from optopad.design.errors import DesignError, ModelScopeError
from optopad.design.fields.finding import Finding
from optopad.design.rules.check import by_weight, notes, require_scope, require_valid
from optopad.design.rules.check import check as findings_of
from optopad.design.rules.shape import is_wide
from optopad.design.spec import SensorDesign
from optopad.screen.check import Checked, findings_screen, rate_words
from optopad.screen.figures import summary_words
from optopad.screen.output import Told


def check(design: SensorDesign) -> Checked:
    """Check a design against the design rules: whether the pad can be manufactured and its verdict computed."""
    return Checked(design=design, findings=findings_of(design))


@verb()
def check_command(design: SensorDesign, *, details: bool = False, asked: Asked) -> Told:
    """Check whether a design can be made and can work; the exit code is 2 if a finding is an error."""
    findings = by_weight((*_contact_findings(design), *findings_of(design)))
    is_bad = any(finding.severity == "error" for finding in findings)
    findings = findings if is_bad else (*findings, *notes(design))
    document = {"name": design.name, "digest": design.digest, "findings": [asdict(one) for one in findings]}
    lines = findings_screen(
        design.name,
        findings,
        command=f"score {asked.words}",
        rate="" if is_bad else rate_words(design),
        size="" if is_bad else summary_words(design, None),
        details=details,
    )
    return Told(document, lines, 2 if is_bad else 0)


def _contact_findings(design: SensorDesign) -> Iterator[Finding]:
    """Findings of the contact model, whose libraries are not loaded for a hemisphere on a pad of ordinary size."""
    if is_wide(Draft(design)):
        return
    try:
        require_valid(design)
        require_scope(design)
    except (DesignError, ModelScopeError):
        return
    from optopad.sims.contact.indentation import wall_findings
    from optopad.sims.contact.scope import contact_of

    yield from wall_findings(contact_of(design))
