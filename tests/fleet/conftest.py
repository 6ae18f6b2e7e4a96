"""What the tests of the fleet begin with: a registry, and a desk for batches."""

from pathlib import Path

import pytest

from camssf_fleet.registry import Registry
from tests.support.desk import Desk


@pytest.fixture
def one(tmp_path: Path) -> Registry:
    return Registry(tmp_path / "phones", new=True)


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)
