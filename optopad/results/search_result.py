"""What a search left behind."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from design.search.explore import Findings


@dataclass(frozen=True, kw_only=True)
class Search:
    """What a search left behind.

    Attributes
    ----------
    folder : with tables, designs and page
    findings : what was found
    files : design file of each design on the front, relative to the folder
    importance : share of each field by objective; empty when too little was judged
    """

    folder: Path
    findings: Findings
    files: tuple[str, ...]
    importance: dict[str, dict[str, float]]
