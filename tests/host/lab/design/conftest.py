"""A store and a cache of the test's own."""

from pathlib import Path

import pytest

from gellight.lab.simulator.sweep import ResultStore, SweepOptions


@pytest.fixture
def options(tmp_path: Path) -> SweepOptions:
    return SweepOptions(store=ResultStore(tmp_path / "store"))


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
