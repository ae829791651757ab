"""Sweeps: results that resume, shards, processes, and the time they take."""

import importlib
import logging
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gellight.base.errors import InputError
from gellight.lab.design import output, studies
from gellight.lab.simulator.sweep import (
    ResultStore,
    Shard,
    Study,
    SweepIncomplete,
    SweepOptions,
    Task,
    parse_shard,
    run,
    run_study,
)
from sim_reference.optimizer.exposing import LightGroups
from tests.helpers.children import started
from tests.helpers.places import CHECKOUT
from tests.helpers.studies import FEW, setup

calls: list[int] = []


@pytest.fixture
def options(tmp_path: Path) -> SweepOptions:
    return SweepOptions(store=ResultStore(tmp_path / "store"))


def square(number: int) -> int:
    calls.append(number)
    if number < 0:
        raise KeyboardInterrupt
    return number**2


def tasks(*numbers: int) -> list[Task]:
    calls.clear()
    return [Task(str(number), square, (number,)) for number in numbers]


def test_an_interrupted_sweep_goes_on_where_it_stopped(options: SweepOptions) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(tasks(1, 2, -1, 3), options)
    assert calls == [1, 2, -1]
    assert run(tasks(1, 2, 3), options) == [1, 4, 9]
    assert calls == [3]


@pytest.mark.parametrize("damage", [b"", b"{}", b"[1]", b'{"key": "x", "sha256": "", "result": 5}', b"\xff\x00"])
def test_a_damaged_result_is_computed_again(
    options: SweepOptions, damage: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    (task,) = tasks(7)
    run([task], options)
    options.store.path(task.key).write_bytes(damage)
    with caplog.at_level(logging.WARNING):
        assert run([task], options) == [49]
    assert calls == [7, 7]
    assert "is damaged" in caplog.text
    assert options.store.get(task.key) == 49


def test_a_result_that_was_altered_is_computed_again(options: SweepOptions) -> None:
    (task,) = tasks(7)
    run([task], options)
    path = options.store.path(task.key)
    path.write_text(path.read_text().replace("49", "50"))
    assert run([task], options) == [49]


def test_shards_are_disjoint_and_add_up(options: SweepOptions) -> None:
    numbered = tasks(0, 1, 2, 3, 4)
    assert run(numbered, replace(options, shard=Shard(1, 2))) == [0, None, 4, None, 16]
    assert run(numbered, replace(options, shard=Shard(2, 2))) == [0, 1, 4, 9, 16]
    assert calls == [0, 2, 4, 1, 3]


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "a/b", "1/2/3", "-1/2"])
def test_a_shard_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="give i/n"):
        parse_shard(text)


def test_a_result_is_named_by_all_that_it_depends_on() -> None:
    groups = LightGroups()
    keys = {
        task.key
        for size in (64, 65)
        for noise in (1.0, 2.0)
        for task in studies.coarse_study(setup(size), replace(groups, noise_grey=noise)).tasks
    }
    assert len(keys) == 4 * len(FEW)
    again = studies.coarse_study(setup(64), groups).tasks
    assert {task.key for task in again} <= keys


def test_a_mended_function_is_computed_anew(
    options: SweepOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = []
    for answer in ("1.5", "2"):
        (tmp_path / "mended_study.py").write_text(f"def answer():\n    return {answer}\n")
        monkeypatch.delitem(sys.modules, "mended_study", raising=False)
        task = Task("one", importlib.import_module("mended_study").answer, ())
        found += run_study(Study([task], list), options)
    assert found == [1.5, 2]


def test_processes_compute_what_one_computes(options: SweepOptions, tmp_path: Path) -> None:
    groups = LightGroups(numbers=(3, 12))
    seen: list[tuple[int, int]] = []
    several = SweepOptions(
        store=ResultStore(tmp_path / "other"), workers=2, progress=lambda done, total, label: seen.append((done, total))
    )
    one, two = (run_study(studies.coarse_study(setup(), groups), how) for how in (options, several))
    assert (one.errors_rad == two.errors_rad).all()
    assert seen == [(done, 4) for done in (0, 1, 2, 3, 4)]


def test_a_study_has_a_result_when_all_its_shards_are_there(options: SweepOptions) -> None:
    study = Study(tasks(3, 2, 1), sum)
    with pytest.raises(SweepIncomplete):
        run_study(study, replace(options, shard=Shard(1, 2)))
    assert calls == [3, 1]
    assert run_study(study, replace(options, shard=Shard(2, 2))) == 14
    assert run_study(replace(study, combine=list), options) == [9, 4, 1]


def die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def linger(folder: str) -> None:
    """Say which process this is, and work for long."""
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(100)


SWEEP = """
import sys
from pathlib import Path
from gellight.lab.simulator.sweep import ResultStore, SweepOptions, Task, run_all
from tests.host.lab.simulator.test_sweep import linger
if __name__ == "__main__":
    folder = sys.argv[1]
    tasks = [Task(str(at), linger, (folder + f"/{at}",)) for at in range(2)]
    run_all(tasks, SweepOptions(store=ResultStore(Path(folder) / "store"), workers=2))
"""


def test_workers_end_with_the_sweep_that_is_killed(tmp_path: Path) -> None:
    for at in range(2):
        (tmp_path / str(at)).mkdir()
    (tmp_path / "sweep.py").write_text(SWEEP)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(CHECKOUT), str(CHECKOUT / "host")])}
    with started([sys.executable, tmp_path / "sweep.py", tmp_path], env=environment) as sweep:
        wait_until(lambda: len(list(tmp_path.glob("[01]/*"))) == 2)
        sweep.kill()
        workers = [Path("/proc") / path.name for path in tmp_path.glob("[01]/*")]
        wait_until(lambda: not any(worker.exists() for worker in workers))


def wait_until(done: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 60
    while not done():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def test_a_worker_that_was_killed_is_reported(options: SweepOptions) -> None:
    with pytest.raises(InputError, match="use fewer --workers than 2"):
        run([Task("die", die, (1,))], replace(options, workers=2))


def test_a_store_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="choose another"):
        ResultStore(tmp_path / "file" / "store")
    with pytest.raises(InputError, match="choose another"):
        output.write_all(tmp_path / "file" / "out", {"x": "y"})
