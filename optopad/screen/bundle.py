"""The bundle that `optopad run` makes: mold, verdict, sheets, firmware, driver configuration, report."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optopad.design.spec import SensorDesign
from optopad.screen.answer import checks_line

if TYPE_CHECKING:
    from optopad.screen.score import Score
    from optopad.sims.score.result import ContinuityScore


@dataclass(frozen=True, kw_only=True, repr=False)
class Bundle:
    """The bundle of a design.

    Attributes
    ----------
    design : the design
    folder : path of the bundle
    checks : results of the mold's checks, as in `cad/checks.json`
    fine, seed : settings of the score
    found : the score; None where the verdict was up to date, so that it is computed when it is asked for
    is_current : whether the bundle was up to date, so that nothing was made
    mended : names of files that were changed or removed after an earlier run, and were made again
    """

    design: SensorDesign
    folder: Path
    checks: dict[str, Any]
    fine: bool
    seed: int
    found: ContinuityScore | None = field(compare=False)
    is_current: bool = False
    mended: tuple[str, ...] = ()

    @cached_property
    def score(self) -> Score:
        """The verdict."""
        from optopad.screen.score import Score
        from optopad.sims.score.scoring import score

        found = self.found or score(self.design, fine=self.fine, seed=self.seed)
        return Score(design=self.design, found=found)

    @property
    def report(self) -> Path:
        """Path of the report page with all results."""
        return self.folder / "report.html"

    @property
    def driver(self) -> Path:
        """Path of the driver configuration, which `optopad.fabrication.driver.Sensor` reads."""
        return self.folder / "fabrication" / "driver.toml"

    @property
    def files(self) -> tuple[Path, ...]:
        """Paths of all files in the bundle."""
        return tuple(sorted(path for path in self.folder.rglob("*") if path.is_file()))

    def __repr__(self) -> str:
        return f"{self.folder}\n{self.score!r}\n{checks_line(self.checks)}"

    def _repr_html_(self) -> str:
        from optopad.screen.answer import block

        return block(str(self.folder), (checks_line(self.checks),), self.score._repr_html_())
