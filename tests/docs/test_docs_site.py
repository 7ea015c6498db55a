"""The site of the docs: every page is two clicks away at most, and what the code names is there."""

import re
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

from offline_check import fetched_from_elsewhere

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FIRST = DOCS / "index.md"
MOST_CLICKS = 2

LINK = re.compile(r"\]\(([^)#\s]+\.(?:md|ipynb))(?:#[^)\s]*)?\)")
TOCTREE = re.compile(r"^```\{toctree\}\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)
NAMED_PAGE = re.compile(r"\bdocs/[A-Za-z0-9_/-]+\.md\b")
CODE = ("design", "cad", "sims", "fabrication", "optopad", "tests", ".ci")
STABLE_NAMES = (
    "optopad.design.spec.SensorDesign",
    "optopad.design.io.load_design",
    "optopad.design.io.save_design",
    "optopad.cad.mold.build_mold",
    "optopad.cad.export.export_parts",
    "optopad.sims.contact.indent",
    "optopad.sims.optics.trace",
    "optopad.sims.score.score",
    "optopad.fabrication.driver.Sensor",
)


def pages() -> set[Path]:
    return {path for path in DOCS.rglob("*") if path.suffix in {".md", ".ipynb"} and "_ext" not in path.parts}


def listed(page: Path, text: str) -> Iterator[Path]:
    """Pages of the toctrees on a page; a pattern stands for all pages that it fits."""
    for block in TOCTREE.findall(text):
        for entry in (line.strip() for line in block.splitlines()):
            if entry and not entry.startswith(":"):
                pattern = (page.parent / entry).as_posix()
                yield from (one for one in pages() if fnmatch(one.with_suffix("").as_posix(), pattern))


def next_to(page: Path) -> set[Path]:
    text = page.read_text(encoding="utf-8")
    linked = {(page.parent / target).resolve() for target in LINK.findall(text) if "://" not in target}
    return (linked | set(listed(page, text))) & pages()


def test_every_page_is_two_clicks_from_the_first_at_most() -> None:
    seen, edge = {FIRST}, {FIRST}
    for _ in range(MOST_CLICKS):
        edge = {found for page in edge for found in next_to(page)} - seen
        seen |= edge
    assert sorted(page.relative_to(DOCS).as_posix() for page in pages() - seen) == []


def named_in(path: Path) -> set[str]:
    return set(NAMED_PAGE.findall(path.read_text(encoding="utf-8", errors="ignore")))


def missing(named: dict[str, set[str]]) -> dict[str, list[str]]:
    absent = {
        name: sorted(page for page in found if not (ROOT / page).is_file()) for name, found in named.items()
    }
    return {name: found for name, found in absent.items() if found}


def test_every_page_that_the_code_names_is_there() -> None:
    kinds = {".py", ".toml", ".c", ".h", ".js", ".html", ".css", ".ino", ""}
    files = [
        path for room in CODE for path in (ROOT / room).rglob("*") if path.is_file() and path.suffix in kinds
    ]
    files += [ROOT / "Makefile", ROOT / "pyproject.toml"]
    assert missing({path.relative_to(ROOT).as_posix(): named_in(path) for path in files}) == {}


def test_every_page_that_the_readme_names_is_there() -> None:
    assert missing({"README.md": named_in(ROOT / "README.md")}) == {}


def test_the_names_that_stay_are_in_the_python_reference() -> None:
    text = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    documented = set(re.findall(r"^\.\. auto\w+:: ([\w.]+)", text, flags=re.MULTILINE))
    assert set(STABLE_NAMES) - documented == set()


def test_what_a_page_would_fetch_from_elsewhere_is_found() -> None:
    page = '<script async src="https://cdn.example/x.js"></script><link rel="stylesheet" href="//fonts.example/a.css">'
    assert len(fetched_from_elsewhere(page)) == 2
    assert fetched_from_elsewhere('@import "https://fonts.example/a.css";', is_style=True)
