"""Studies go on where they stopped, and compute anew what depends on changed sources."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from gellight.base.errors import InputError
from gellight_design import output, studies
from gellight_design.sweep import Study, Task, kept_in, run_study
from sim_reference.optimizer.exposing import LightGroups
from tests.helpers.studies import FEW, setup

calls: list[int] = []


def square(number: int) -> int:
    calls.append(number)
    if number < 0:
        raise KeyboardInterrupt
    return number**2


def squares(*numbers: int) -> Study[list[int]]:
    calls.clear()
    return Study([Task(str(number), square, (number,)) for number in numbers], list)


def test_an_interrupted_study_goes_on_where_it_stopped() -> None:
    with pytest.raises(KeyboardInterrupt):
        run_study(squares(1, 2, -1, 3))
    assert calls == [1, 2, -1]
    assert run_study(squares(1, 2, 3)) == [1, 4, 9]
    assert calls == [3]


@pytest.mark.parametrize("damage", [b"", b"[1]", b"\xff\x00"])
@pytest.mark.filterwarnings("ignore:Exception while loading")
def test_a_damaged_result_is_computed_again(damage: bytes) -> None:
    run_study(squares(7))
    (kept,) = kept_in().rglob("output.pkl")
    kept.write_bytes(damage)
    assert run_study(squares(7)) == [49]
    assert calls == [7]
    assert run_study(squares(7)) == [49]
    assert calls == []


def test_a_result_is_kept_by_all_that_it_depends_on() -> None:
    for size in (64, 65):
        for noise in (1.0, 2.0, 1.0):
            groups = LightGroups(numbers=(3,), angles_rad=(0.5,), noise_grey=noise)
            run_study(studies.coarse_study(setup(size), groups))
    assert len(list(kept_in().rglob("output.pkl"))) == 4 * len(FEW)


def test_a_mended_function_is_computed_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = []
    for answer in ("1.5", "2"):
        (tmp_path / "mended_study.py").write_text(f"def answer():\n    return {answer}\n")
        monkeypatch.delitem(sys.modules, "mended_study", raising=False)
        found += run_study(Study([Task("one", importlib.import_module("mended_study").answer, ())], list))
    assert found == [1.5, 2]


def test_processes_compute_what_one_computes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    study = studies.coarse_study(setup(), LightGroups(numbers=(3, 12)))
    one, seen = run_study(study), []
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    two = run_study(study, 2, lambda done, total, label: seen.append((done, total)))
    assert (one.errors_rad == two.errors_rad).all()
    assert seen == [(done, 4) for done in (0, 1, 2, 3, 4)]
    assert (run_study(replace(study, combine=list))[3] == one.errors_rad[3]).all()


def test_results_that_cannot_be_kept_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="choose another"):
        output.write_all(tmp_path / "file" / "out", {"x": "y"})
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InputError, match="let XDG_CACHE_HOME name another folder"):
        run_study(squares(1))
