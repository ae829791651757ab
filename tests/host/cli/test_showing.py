"""Results of verbs, for people and for programs."""

import json
import time
from dataclasses import dataclass
from typing import Any

import pytest
from pydantic import BaseModel

from gellight.cli import showing
from gellight.cli.showing import progress, show


@dataclass(frozen=True)
class Part:
    depth_mm: float
    error: str | None = None


class Kept(BaseModel):
    name: str


class Figures:
    def as_json(self) -> dict[str, object]:
        return {"parts": (Part(1.5),)}


@pytest.mark.parametrize(
    ("result", "told"),
    [
        ({"a": [Part(0.5, "no")]}, {"a": [{"depth_mm": 0.5, "error": "no"}]}),
        ([Kept(name="it")], [{"name": "it"}]),
        (Figures(), {"parts": [{"depth_mm": 1.5, "error": None}]}),
    ],
)
def test_programs_get_one_line_of_json(result: object, told: object, capsys: pytest.CaptureFixture[str]) -> None:
    show(result, True, "for people")
    shown = capsys.readouterr().out
    assert json.loads(shown) == told
    assert shown.count("\n") == 1


@pytest.mark.parametrize(
    ("result", "text", "shown"),
    [(Part(0.5), None, "depth_mm  0.5\n"), ({"a": 1, "of": 2}, None, "a   1\nof  2\n"), (Part(0.5), "deep", "deep\n")],
)
def test_people_get_text_or_a_table(
    result: object, text: str | None, shown: str, capsys: pytest.CaptureFixture[str]
) -> None:
    show(result, False, text)
    assert capsys.readouterr().out == shown


def test_what_json_does_not_know_is_an_error_and_not_a_guess() -> None:
    strange: Any = object()
    with pytest.raises(TypeError, match="cannot be shown as JSON"):
        show({"it": strange}, True)


def test_a_log_has_a_line_now_and_then_and_first_how_long_it_takes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("training") as tell:
        tell(1, 2, 0.25)
    assert capsys.readouterr() == ("", ""), "what ends within ten seconds needs none"
    monkeypatch.setattr(showing, "LOG_S", 0.2)
    with progress("training", "a minute") as tell:
        tell(3, 40, 0.25)
        time.sleep(0.5)
        tell(None, None, "step 3")
        time.sleep(0.5)
    first, second, *_, last = capsys.readouterr().err.splitlines()
    assert first == "training: takes a minute"
    assert second == "training, 3 of 40 (0 s)"
    assert last.startswith("training: step 3, 3 of 40 (")
