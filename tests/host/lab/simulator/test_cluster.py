"""A Dask cluster computes what the processes of this machine compute."""

import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gellight.base.errors import InputError
from gellight.lab.design import studies
from gellight.lab.simulator.sweep import ResultStore, SweepOptions, Task, executor, run, run_study
from sim_reference.geometry import SensorGeometry
from sim_reference.optimizer.exposing import LightGroups
from tests.helpers.children import run as run_program
from tests.helpers.command_line import invoke
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly
GROUPS = LightGroups(numbers=(3, 12), angles_rad=tuple(np.radians([21.0, 29.0, 37.0])))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as started:
        yield started


def setup() -> studies.StudySetup:
    return replace(studies.study_setup(SensorGeometry(), 0.9, 1.0, 48), names=("TSTEP", "WAVE"))


def test_a_cluster_gives_the_results_of_this_machine(cluster: Any, tmp_path: Path) -> None:
    far = SweepOptions(store=ResultStore(tmp_path / "far"), scheduler=cluster.scheduler_address)
    near = SweepOptions(store=ResultStore(tmp_path / "near"))
    on_cluster = run_study(studies.coarse_study(setup(), GROUPS), far)
    here = run_study(studies.coarse_study(setup(), GROUPS), near)
    np.testing.assert_array_equal(on_cluster.errors_rad, here.errors_rad)


def test_what_a_cluster_computed_is_kept(cluster: Any, tmp_path: Path) -> None:
    store = ResultStore(tmp_path)
    first = run_study(
        studies.coarse_study(setup(), GROUPS), SweepOptions(store=store, scheduler=cluster.scheduler_address)
    )
    again = run_study(studies.coarse_study(setup(), GROUPS), SweepOptions(store=store, scheduler="tcp://127.0.0.1:1"))
    np.testing.assert_array_equal(again.errors_rad, first.errors_rad, "nothing was missing, so no cluster was asked")


def test_episodes_of_the_page_have_the_same_bytes_from_a_cluster(cluster: Any, tmp_path: Path) -> None:
    program = CHECKOUT / "docs/examples/simulators/episodes.py"

    def make(folder: str, *asked: str) -> list[str]:
        done = run_program([sys.executable, program, tmp_path / folder, *asked], check=True, timeout_s=100)
        return [line.split(":")[0] for line in done.stdout.splitlines()]

    assert make("near", "2") == ["000000", "000001"]
    shutil.copytree(tmp_path / "near/000000", tmp_path / "far/000000")
    assert make("far", "2", cluster.scheduler_address) == ["000001"], "it goes on"
    near, far = ((tmp_path / name / "000001/000000.tar").read_bytes() for name in ("near", "far"))
    assert near == far


def test_a_cluster_that_is_not_there_is_named(tmp_path: Path) -> None:
    options = SweepOptions(store=ResultStore(tmp_path), scheduler="tcp://127.0.0.1:1")
    result = invoke("optimize", "coarse", "--scheduler", "tcp://127.0.0.1:1", "--store", str(tmp_path))
    assert isinstance(result.exception, InputError)
    assert "no Dask scheduler at tcp://127.0.0.1:1" in str(result.exception)
    assert run([], options) == []


class Foreign:
    """An argument that only a program with another module can read."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return import_module, ("gellight_of_tomorrow",)


def test_a_cluster_with_another_gellight_is_told(cluster: Any, tmp_path: Path) -> None:
    options = SweepOptions(store=ResultStore(tmp_path), scheduler=cluster.scheduler_address)
    with pytest.raises(InputError, match="need the GelLight that this program has"):
        run([Task("0", _slowly, (Foreign(),))], options)


def test_a_cluster_that_goes_away_loses_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=0, threads_per_worker=1, dashboard_address=None) as leaving:

        def tell(done: int, of: int, label: str) -> None:
            if label:
                leaving.close()

        store = ResultStore(tmp_path)
        options = SweepOptions(store=store, scheduler=leaving.scheduler_address, progress=tell)
        with executor(options):
            assert "waiting for workers: start some with `dask worker" in caplog.text
        leaving.scale(1)
        tasks = [Task(str(at), _slowly, (at,)) for at in range(4)]
        with pytest.raises(InputError, match=r"is gone. What is done is kept in"):
            run(tasks, options)
    kept = [store.get(task.key) for task in tasks]
    assert 0 < kept.count(None) < 4
    assert run(tasks, SweepOptions(store=store)) == [0, 1, 2, 3]


def _slowly(number: int) -> int:
    time.sleep(0.5)
    return number
