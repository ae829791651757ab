"""A small setup of the optimizer's studies, and a fixture: a cache of the test's own."""

from dataclasses import replace

import pytest

from gellight_design import studies
from sim_reference.geometry import SensorGeometry

FEW = ("TSTEP", "SCROWN", "SINWAVE", "BSWAVE")


def setup(size: int = 64, names: tuple[str, ...] = FEW) -> studies.StudySetup:
    """Return the studies' input for `size` x `size` pixels and the objects `names`."""
    return replace(studies.study_setup(SensorGeometry(), 0.9, 1.0, size), names=names)


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
