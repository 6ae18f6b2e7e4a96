"""What the fleet's tests begin with: a registry, a desk for batches, one database for all connections."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from camssf_fleet.registry import Registry
from tests.support.desk import Desk


@pytest.fixture(autouse=True, scope="module")
def one_database() -> Iterator[None]:
    """Each connection is a cursor of one database in memory: to open one takes 25 ms, thousands of times."""
    import duckdb

    from camssf_fleet.record_queries import _CONFIG

    database = duckdb.connect(":memory:", config=_CONFIG | {"threads": 1, "enable_external_file_cache": False})
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(duckdb, "connect", lambda *_, **__: database.cursor())
        yield


@pytest.fixture
def one(tmp_path: Path) -> Registry:
    return Registry(tmp_path / "phones", new=True)


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)
