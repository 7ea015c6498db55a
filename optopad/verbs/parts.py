"""Lists the packaged catalogue."""

from __future__ import annotations

from dataclasses import asdict

from optopad.cli.verb import typed, verb
from optopad.design.parts.catalog import packaged
from optopad.design.parts.listing import listed
from optopad.screen.catalogue import overview
from optopad.screen.output import Told


@verb(kind=typed("GROUP"))
def parts(*, kind: str | None = None) -> Told:
    """List the packaged catalogue: parts, silicones, plastics, boards and chips, with main figures and sources.

    Parameters
    ----------
    kind : One group: emitters, receivers, silicones, plastics, boards and others.
    """
    found = listed(packaged(), kind)
    return Told({"entries": [asdict(one) for one in found]}, overview(found, is_whole=kind is None))
