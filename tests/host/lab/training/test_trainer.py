"""What trains: the rehearsal, and the child that computes."""

import os
import subprocess
import sys
import time
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from gellight.base.errors import TrainingError
from gellight.lab.training import child, training
from gellight.lab.training.training import check_trainer, rehearse
from gellight.sensor.findings import Level
from tests.helpers.waiting import eventually


@pytest.fixture(autouse=True)
def unrehearsed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "_rehearsed", [])


def test_a_rehearsal_trains_for_real_and_names_what_trained() -> None:
    library, version = rehearse().split()
    assert library == "numpy"
    assert version[0].isdigit()


def test_doctor_names_what_trains() -> None:
    finding = check_trainer()
    assert finding.level is Level.OK
    assert finding.text.startswith("numpy ")


def test_a_library_that_cannot_be_loaded_is_found_before_anybody_presses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is installed and broken: what it depends on is missing."""
    (tmp_path / "onnxruntime.py").write_text("raise ImportError('libgomp.so.1 is missing')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(TrainingError, match=r"libgomp.so.1 is missing.*repair"):
        rehearse()
    finding = check_trainer()
    assert finding.level is Level.WARNING
    assert "libgomp.so.1 is missing" in finding.text
    assert "repair" in finding.remedy


def test_a_process_rehearses_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    monkeypatch.setattr(training, "_trained_by", lambda check: calls.append("trained") or "numpy 1")
    assert [rehearse(), rehearse()] == ["numpy 1"] * 2
    assert calls == ["trained"]


def test_a_child_computes_with_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    script = "import json, os; print(json.dumps({'epoch': int(os.environ['OMP_NUM_THREADS']), 'epochs': 9, 'loss': 0}))"
    seen: list[int] = []
    child._run_child([sys.executable, "-c", script], lambda epoch, epochs, loss: seen.append(epoch))
    assert seen == [1]


def test_a_child_that_says_nothing_can_be_stopped() -> None:
    """An abort must not wait for the next epoch."""
    children: list[int] = []

    def stop() -> None:
        if children:
            raise KeyboardInterrupt

    script = (
        'import os, time; print(\'{"epoch": %d, "epochs": 9, "loss": 0}\' % os.getpid(), flush=True); time.sleep(99)'
    )
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        child._run_child([sys.executable, "-c", script], lambda epoch, epochs, loss: children.append(epoch), check=stop)
    assert time.monotonic() - begun < 60
    with pytest.raises(ProcessLookupError):
        os.kill(children[0], 0)


@pytest.mark.parametrize("spec", [None, ModuleSpec("gelnet", None)], ids=["missing", "a module"])
def test_without_the_package_gelnet_it_says_what_to_do(
    spec: ModuleSpec | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(child.importlib.util, "find_spec", lambda name: spec)
    with pytest.raises(TrainingError, match="gelnet is not installed beside gellight: reinstall"):
        child.gelnet_environment()


def test_a_child_ends_with_the_program_that_started_it(tmp_path: Path) -> None:
    """However that ended: an interrupt may come before it knows of its child."""
    starts = "import os, subprocess, sys; p = subprocess.Popen(sys.argv[1:], stdin=subprocess.PIPE); print(p.pid); "
    module = [sys.executable, "-m", "gelnet.synthetic", "--trainer=numpy", "--attached", "--out", str(tmp_path / "o")]
    started = subprocess.run(
        [sys.executable, "-c", f"{starts}sys.stdout.flush(); os._exit(0)", *module],
        env=child.gelnet_environment(), stdout=subprocess.PIPE, text=True, check=True, timeout=60,
    )  # fmt: skip
    command = Path(f"/proc/{int(started.stdout)}/cmdline")
    eventually(lambda: not command.exists() or command.read_bytes() == b"")  # that of a zombie is empty
