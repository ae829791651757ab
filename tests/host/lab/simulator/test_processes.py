"""Calls that are spread over processes: none is left behind, and a worker that dies is told."""

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from gellight.base.errors import InputError
from gellight.lab.simulator.processes import call_all
from tests.helpers.children import started
from tests.helpers.places import CHECKOUT
from tests.helpers.waiting import eventually


def square(number: int) -> int:
    return number**2


def test_results_come_in_the_order_of_the_calls() -> None:
    done: list[int] = []
    assert call_all(square, [(3,), (2,), (1,)], 2, done.append) == [9, 4, 1]
    assert sorted(done) == [0, 1, 2]


def die(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_worker_that_was_killed_is_reported() -> None:
    with pytest.raises(InputError, match="use fewer --workers than 2"):
        call_all(die, [(1,)], 2)


def linger(folder: str) -> None:
    """Say which process this is, and work for long."""
    (Path(folder) / str(os.getpid())).touch()
    time.sleep(100)


CALLS = """
import sys
from gellight.lab.simulator.processes import call_all
from tests.host.lab.simulator.test_processes import linger
if __name__ == "__main__":
    call_all(linger, [(sys.argv[1] + f"/{at}",) for at in range(2)], 2)
"""


def test_workers_end_with_the_program_that_is_killed(tmp_path: Path) -> None:
    for at in range(2):
        (tmp_path / str(at)).mkdir()
    (tmp_path / "calls.py").write_text(CALLS)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(CHECKOUT), str(CHECKOUT / "host")])}
    with started([sys.executable, tmp_path / "calls.py", tmp_path], env=environment) as program:
        eventually(lambda: len(list(tmp_path.glob("[01]/*"))) == 2, 60)
        program.kill()
        workers = [Path("/proc") / path.name for path in tmp_path.glob("[01]/*")]
        eventually(lambda: not any(worker.exists() for worker in workers), 60)
