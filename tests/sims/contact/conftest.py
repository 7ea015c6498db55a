"""One coarse solve shared by the contact tests; nothing touches the user's cache."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from design.preset import preset
from design.spec import SensorDesign
from sims.contact.indentation import solved_press
from sims.contact.library.solved_press import SolvedPress

COARSE_MM = 0.45


@pytest.fixture(scope="session", autouse=True)
def contact_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OPTOPAD_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session")
def check_design() -> SensorDesign:
    """8 mm elastic depth, 3 mm tip, 1 MPa: the case of the study's check values."""
    return preset("piacenza2017-pad").with_(
        **{
            "cavity.clear_thickness_mm": 7.0,
            "cavity.black_thickness_mm": 1.0,
            "indenter.tip_radius_mm": 3.0,
            "elastomer.youngs_modulus_mpa": 1.0,
            "operating.max_depth_mm": 3.0,
        }
    )


@pytest.fixture(scope="session")
def coarse_press(check_design: SensorDesign) -> SolvedPress:
    return solved_press(check_design, mesh_mm=COARSE_MM)


@pytest.fixture(scope="session")
def shallow_press(check_design: SensorDesign) -> SolvedPress:
    """From the library."""
    return solved_press(check_design, 0.5)
