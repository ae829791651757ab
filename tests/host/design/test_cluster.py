"""A Dask cluster computes what the processes of this machine compute."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from gellight.base.errors import InputError
from gellight.design import answers, studies
from gellight.design.store import ResultStore
from gellight.design.sweep import Way, run
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer.exposing import LightGroups

GROUPS = LightGroups(numbers=(3, 12), angles_rad=tuple(np.radians([21.0, 29.0, 37.0])))


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as started:
        yield started


def subject() -> studies.Subject:
    return replace(answers.subject_of(SensorGeometry(), 0.9, 1.0, 48), names=("TSTEP", "WAVE"))


def test_a_cluster_gives_the_results_of_this_machine(cluster: LocalCluster, tmp_path: Path) -> None:
    far = Way(store=ResultStore(tmp_path / "far"), scheduler=cluster.scheduler_address)
    near = Way(store=ResultStore(tmp_path / "near"))
    on_cluster = studies.coarse_study(subject(), GROUPS, far)
    here = studies.coarse_study(subject(), GROUPS, near)
    assert on_cluster is not None
    assert here is not None
    np.testing.assert_array_equal(on_cluster.errors_rad, here.errors_rad)


def test_what_a_cluster_computed_is_kept(cluster: LocalCluster, tmp_path: Path) -> None:
    store = ResultStore(tmp_path)
    studies.coarse_study(subject(), GROUPS, Way(store=store, scheduler=cluster.scheduler_address))
    again = studies.coarse_study(subject(), GROUPS, Way(store=store, scheduler="tcp://127.0.0.1:1"))
    assert again is not None, "nothing was missing, so no cluster was asked"


def test_a_cluster_that_is_not_there_is_named(tmp_path: Path) -> None:
    way = Way(store=ResultStore(tmp_path), scheduler="tcp://127.0.0.1:1")
    with pytest.raises(InputError, match=r"no Dask scheduler at tcp://127\.0\.0\.1:1"):
        studies.coarse_study(subject(), GROUPS, way)
    assert run([], way) == []
