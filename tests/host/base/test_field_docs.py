"""`help()` of a public dataclass shows its fields and what is written below them."""

import dataclasses
import inspect
import pydoc
from unittest.mock import Mock

import pytest

import gellight
from gellight.frames.frames import ExposureSeries

CLASSES = [name for name in gellight.__all__ if dataclasses.is_dataclass(getattr(gellight, name))]


@pytest.mark.parametrize("name", CLASSES)
def test_help_shows_every_field(name: str) -> None:
    shown = pydoc.plain(pydoc.render_doc(getattr(gellight, name)))
    for field in dataclasses.fields(getattr(gellight, name)):
        assert f"{field.name}: " in shown.partition("Fields:")[2].partition("Method")[0]


def test_a_field_is_told_as_it_stands_in_the_source_where_that_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(CLASSES) >= 6
    assert "depth_mm: NDArray[np.float32]\n    (H, W) mm" in (gellight.TactileFrame.__doc__ or "")
    told = inspect.getdoc(ExposureSeries) or ""
    assert told.index("image: ") < told.index("groups: "), "those of the base class first"
    monkeypatch.setattr(inspect, "getsource", Mock(side_effect=OSError("could not get source code")))
    assert (gellight.Contact.__doc__ or "").count("\n") < 8
