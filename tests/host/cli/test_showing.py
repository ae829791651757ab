"""Results of verbs, for people and for programs."""

import json
from dataclasses import dataclass
from typing import Any

import pytest
from pydantic import BaseModel

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


def test_nothing_moves_where_the_output_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("training") as tell:
        tell(1, 2, 0.25)
        tell(None, None, "step 3")
    assert capsys.readouterr() == ("", "")
