"""Coarse presses shared by the contact tests, read from files; nothing touches the user's cache."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from optopad.design.spec import SensorDesign
from optopad.sims.contact.indentation import solved_press
from optopad.sims.contact.library import stored_press
from optopad.sims.contact.library.solved_press import SolvedPress
from optopad.sims.contact.scope import contact_of
from tests.sims.contact import kept_presses
from tests.sims.contact.kept_presses import COARSE_MM, kept_or_solved


@pytest.fixture(scope="session", autouse=True)
def contact_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OPTOPAD_CACHE", str(folder))
        patch.setattr(stored_press, "_solve", kept_or_solved(stored_press._solve))
        yield folder


@pytest.fixture(scope="session")
def check_design() -> SensorDesign:
    """8 mm elastic depth, 3 mm tip, 1 MPa: the case of the study's check values."""
    return kept_presses.check_design()


@pytest.fixture(scope="session")
def coarse_press(check_design: SensorDesign) -> SolvedPress:
    """As it was solved when `kept_presses` was run; a slow test solves it live."""
    return solved_press(contact_of(check_design), mesh_mm=COARSE_MM)


@pytest.fixture(scope="session")
def shallow_press(check_design: SensorDesign) -> SolvedPress:
    """From the library."""
    return solved_press(contact_of(check_design), 0.5)
