"""A bundle on disk, and the score it was made with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from optopad.front.judged import Score
from optopad.front.shown import block
from optopad.screen.summary import checks_line


@dataclass(frozen=True, kw_only=True, repr=False)
class Bundle:
    """One folder a design: mold, verdict, sheets, firmware, driver configuration, report.

    Attributes
    ----------
    folder : where it lies
    score : the verdict
    checks : the mold's checks, as in `cad/checks.json`
    """

    folder: Path
    score: Score
    checks: dict[str, Any]

    @property
    def report(self) -> Path:
        """The page with everything at a glance."""
        return self.folder / "report.html"

    @property
    def driver(self) -> Path:
        """The configuration that `fabrication.driver.Sensor` takes."""
        return self.folder / "fabrication" / "driver.toml"

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file of the bundle."""
        return tuple(sorted(path for path in self.folder.rglob("*") if path.is_file()))

    def __repr__(self) -> str:
        return f"{self.folder}\n{self.score!r}\n{checks_line(self.checks)}"

    def _repr_html_(self) -> str:
        return block(str(self.folder), (checks_line(self.checks),), self.score._repr_html_())
