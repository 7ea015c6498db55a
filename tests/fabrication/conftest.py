"""The simulated board's program, compiled once; tests that need it skip where a tool is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fabrication.simulated_board import build_harness, missing_tools


@pytest.fixture(scope="session")
def board_harness(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if missing := missing_tools():
        pytest.skip(missing)
    return build_harness(tmp_path_factory.mktemp("harness"))
