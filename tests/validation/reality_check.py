"""The page docs/validation/reality.md: the paper's experiment on its pad, simulated, beside what the paper reports.

    python -m tests.validation.reality_check            five draws of the whole protocol; slow learners one
    python -m tests.validation.reality_check --fresh    the same, with nothing taken from an interrupted run

Light is traced once (and read from the light store), the signal chain drawn five times; every learner is trained on the
training sets of each draw alone. Finished fits stay in `build/validation/reality/` under a hash of all sources. No
constant of the chain or of a learner is set by the numbers that the page compares with.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import numpy as np

from design.cavity import workspace_of
from design.preset import preset
from design.protocol import load_protocol_file
from design.spec import SensorDesign
from optopad.accuracy import ModelAccuracy, accuracy_of
from optopad.evaluation import accuracies
from optopad.finished import source_digest
from optopad.prediction import bound_mm
from sims.evaluation.judged import JudgedPresses
from sims.evaluation.published import PublishedTouch, published_touch
from sims.evaluation.tables import TOUCH_DEPTHS_MM
from sims.learning.inference.signal_map_model import KIND as SIGNAL_MAP
from sims.learning.learners import LEARNERS, Learner
from sims.learning.map_learner import signal_map_learner
from sims.learning.settings import DEFAULT, FitSettings
from sims.protocol import ProtocolCurves, draw, protocol_curves
from tests.validation.contact_table import markdown_table, with_table

PAGE = Path(__file__).parents[2] / "docs" / "validation" / "reality.md"
BUILD = Path(__file__).parents[2] / "build" / "validation" / "reality"
MARKS = "<!-- made by tests/validation/reality_check.py -->", "<!-- end -->"
DESIGN = "piacenza2017-pad"
PROTOCOL = "piacenza2017"
OFTEN = {"kernel-ridge": 5, "extra-trees": 5, SIGNAL_MAP: 5}
ONCE = {"network": 1, "gaussian-process": 1}
"""Draws of the chain that each learner is trained and judged on, the paper's learner first; the slow ones last."""
NEAR_PAPER = 0.15
"""A row of touch from 0.2 mm on agrees with the paper within this [-]."""
UNTOUCHED_LIMIT = 0.95
ZERO_LIMIT = 0.20
"""Least share of untouched rows, largest share at 0 mm [-]."""
DEPTH_SHARE = 0.95
LOCATION_LIMIT_MM = 1.0

Judged = dict[tuple[str, str], list[JudgedPresses]]
"""By learner and test set, a draw each."""


def fits_of(design: SensorDesign, *, quick: bool = False) -> dict[str, Learner]:
    """Every learner; the map is traced at its first fit."""
    return LEARNERS | {SIGNAL_MAP: signal_map_learner(design, quick=quick)}


def judged_draws(
    curves: ProtocolCurves,
    fits: Mapping[str, Learner],
    draws: Mapping[str, int],
    *,
    folder: Path = BUILD,
    settings: FitSettings = DEFAULT,
) -> Judged:
    """Train and judge, draw by draw; what is in the folder already is taken from there.

    Parameters
    ----------
    draws : how many for each learner, in the order of the tables
    """
    found: Judged = {}
    for seed in range(max(draws.values())):
        wanted = [name for name, count in draws.items() if seed < count]
        left = [name for name in wanted if not _file(folder, curves, name, seed, settings).exists()]
        if left:
            data = draw(curves, seed=seed)
            for name in left:
                start = perf_counter()
                model = fits[name](data.role("train"), seed=seed, settings=settings)
                tables = accuracies(
                    model,
                    data.role("test"),
                    workspace_of(curves.design),
                    on_step=lambda *_: None,
                    learner=name,
                )
                _keep(_file(folder, curves, name, seed, settings), tables)
                print(f"draw {seed}, {name}: {perf_counter() - start:.0f} s", file=sys.stderr, flush=True)
        for name in wanted:
            for test_set, presses in _kept(_file(folder, curves, name, seed, settings)).items():
                found.setdefault((name, test_set), []).append(presses)
    order = {name: number for number, name in enumerate(draws)}
    return dict(sorted(found.items(), key=lambda item: order[item[0][0]]))


def _file(folder: Path, curves: ProtocolCurves, learner: str, seed: int, settings: FitSettings) -> Path:
    asked = f"{curves.design.digest} {curves.protocol.digest} {settings} {learner} {seed} {source_digest()}"
    return folder / f"{learner}-{seed}-{sha256(asked.encode()).hexdigest()[:12]}.npz"


def _keep(file: Path, tables: Sequence[ModelAccuracy]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    arrays = {
        f"{one.test_set}/{part.name}": getattr(one.presses, part.name)
        for one in tables
        for part in fields(JudgedPresses)
    }
    partial = file.with_suffix(".partial.npz")
    np.savez(partial, **arrays)
    partial.rename(file)


def _kept(file: Path) -> dict[str, JudgedPresses]:
    with np.load(file, allow_pickle=False) as stored:
        names = dict.fromkeys(name.partition("/")[0] for name in stored.files)
        return {
            name: JudgedPresses(
                **{part.name: stored[f"{name}/{part.name}"] for part in fields(JudgedPresses)}
            )
            for name in names
        }


def pooled(found: Judged) -> dict[tuple[str, str], ModelAccuracy]:
    """All draws of a learner on a set as one."""
    return {
        (name, test_set): accuracy_of(name, test_set, "ambient" in test_set, parts)
        for (name, test_set), parts in found.items()
    }


def touch_table(found: Mapping[tuple[str, str], ModelAccuracy], published: PublishedTouch) -> str:
    """The first learner's touch on both test sets beside the paper's."""
    learner = next(iter(found))[0]
    sets = [one for (name, _), one in found.items() if name == learner]
    rows = []
    for number, depth in enumerate(TOUCH_DEPTHS_MM):
        cells = [f"{depth:g}"]
        for one in sets:
            row = one.touch[number]
            paper = published.right(depth, is_ambient=one.is_ambient)
            assert row.right is not None
            assert paper is not None
            cells += [
                f"{row.right:.2f} ± {row.right_error or 0.0:.2f}",
                f"{paper:.2f}",
                f"{row.right - paper:+.2f}",
            ]
        rows.append(cells)
    head = ["depth mm"]
    for one in sets:
        head += [one.test_set, "paper", "difference"]
    return markdown_table(head, rows)


def touch_misses(found: Mapping[tuple[str, str], ModelAccuracy], published: PublishedTouch) -> list[str]:
    """Rows outside what was asked for, in words; the draws and both sets together."""
    learner = next(iter(found))[0]
    sets = [one for (name, _), one in found.items() if name == learner]
    misses = []
    for number, depth in enumerate(TOUCH_DEPTHS_MM):
        rights = [one.touch[number].right for one in sets]
        papers = [published.right(depth, is_ambient=one.is_ambient) for one in sets]
        right = float(np.mean([value for value in rights if value is not None]))
        paper = float(np.mean([value for value in papers if value is not None]))
        if depth < 0.0 and right < UNTOUCHED_LIMIT:
            misses.append(f"{depth:g} mm: {right:.2f} told rightly, asked {UNTOUCHED_LIMIT:g}")
        elif depth == 0.0 and right > ZERO_LIMIT:
            misses.append(f"0 mm: {right:.2f} found, asked at most {ZERO_LIMIT:g}")
        elif depth > 0.0 and abs(right - paper) > NEAR_PAPER:
            misses.append(f"{depth:g} mm: {right:.2f}, the paper {paper:.2f}, {right - paper:+.2f}")
    return misses


def error_table(found: Mapping[tuple[str, str], ModelAccuracy]) -> str:
    """Errors of place and depth, a row a learner, set and depth."""
    rows = []
    for (name, test_set), one in found.items():
        for row in one.errors:
            if row.location is None or row.depth is None:
                continue
            rows.append(
                [
                    name, test_set, f"{row.depth_mm:g}",
                    f"{row.location.median:.3f} ± {row.location.median_error:.3f}",
                    f"{row.location.mean:.3f}", f"{row.location.deviation:.3f}",
                    f"{row.depth.median:.3f}", f"{row.depth.mean:.3f}", f"{row.depth.deviation:.3f}",
                    f"{row.within:.1%}", f"{row.found:.0%}",
                ]
            )  # fmt: skip
    head = [
        "learner", "test set", "depth mm", "place: median", "mean", "sd", "depth: median", "mean", "sd",
        "depth within 0.5 mm", "found",
    ]  # fmt: skip
    return markdown_table(head, rows)


def headline(found: Mapping[tuple[str, str], ModelAccuracy]) -> list[str]:
    """For every learner whether the paper's own headline holds: place below 1 mm, depth within 0.5 mm."""
    lines = []
    for name in dict.fromkeys(name for name, _ in found):
        rows = [row for (learner, _), one in found.items() if learner == name for row in one.errors]
        place = [row for row in rows if row.location and row.depth_mm >= 1.0]
        bad = sorted(
            {row.depth_mm for row in place if row.location and row.location.median >= LOCATION_LIMIT_MM}
        )
        deep = sorted({row.depth_mm for row in rows if row.depth_mm >= 0.5 and row.within < DEPTH_SHARE})
        lines.append(
            f"- {name}: median place below 1 mm from 1 mm on: {_holds(bad)}; depth within 0.5 mm at 95 % from 0.5 mm "
            f"on: {_holds(deep)}."
        )
    return lines


def _holds(missed_mm: Sequence[float]) -> str:
    return "yes" if not missed_mm else f"not at {', '.join(f'{depth:g}' for depth in missed_mm)} mm"


def markdown(
    found: Mapping[tuple[str, str], ModelAccuracy],
    draws: Mapping[str, int],
    bound_mm: Mapping[float, tuple[float, float]],
) -> str:
    """All tables and what does not match."""
    published = published_touch(preset(DESIGN))
    assert published is not None
    misses = touch_misses(found, published)
    learner = next(iter(found))[0]
    return "\n\n".join(
        [
            f"Protocol {PROTOCOL}; draws: {', '.join(f'{name} {count}' for name, count in draws.items())}. "
            f"scikit-learn {version('scikit-learn')}, numpy {version('numpy')}.",
            f"### Touch, {learner}",
            touch_table(found, published),
            "Outside what was asked for: " + ("; ".join(misses) + "." if misses else "nothing."),
            "### Place and depth",
            "\n".join(headline(found)),
            error_table(found),
            "### Cramér-Rao bound under the same chain, median over places",
            markdown_table(
                ["depth mm", "place mm", "depth mm (standard deviation)"],
                [
                    [f"{depth:g}", f"{place:.4f}", f"{of_depth:.4f}"]
                    for depth, (place, of_depth) in bound_mm.items()
                ],
            ),
        ]
    )


def design_and_curves(accuracy: str = "draft") -> tuple[SensorDesign, ProtocolCurves]:
    """The paper's pad and its protocol's light."""
    design = preset(DESIGN)
    return design, protocol_curves(design, load_protocol_file(PROTOCOL), accuracy=accuracy, on_step=_told)


def _told(stage: str, share: float) -> None:
    if share >= 1.0:
        print(f"{stage}: done", file=sys.stderr, flush=True)


def main(arguments: Sequence[str]) -> None:
    """Make the page."""
    if "--fresh" in arguments:
        for file in BUILD.glob("*.npz"):
            file.unlink()
    design, curves = design_and_curves()
    fits = fits_of(design)
    found = pooled(judged_draws(curves, fits, OFTEN) | judged_draws(curves, fits, ONCE))
    bound = bound_mm(design, curves, 0, _told)
    page = with_table(PAGE.read_text(encoding="utf-8"), markdown(found, OFTEN | ONCE, bound), MARKS)
    PAGE.write_text(page, encoding="utf-8")
    print(PAGE)


if __name__ == "__main__":
    main(sys.argv[1:])
