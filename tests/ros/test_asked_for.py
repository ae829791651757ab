"""The settings that ask for ROS 2 and Foxglove, with the distribution that has them and without it."""

import tomllib
from importlib.metadata import EntryPoint

import pytest

from gellight.base import beside
from gellight.base.settings import load_settings
from gellight.cli.one_sensor import bridges
from tests.helpers.command_line import invoke, refused
from tests.helpers.places import CHECKOUT

GROUP = "gellight.bridges"
ASKED = {"ros2": ("tcp/localhost:7447", "ros"), "foxglove": ("true", "foxglove")}


@pytest.mark.parametrize("name", ASKED)
def test_where_it_is_not_installed_one_line_says_so_before_a_sensor_is_opened(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(beside, "entry_points", lambda **_: ())
    value, extra = ASKED[name]
    said = refused(invoke("run", "--sensor", "v4l2:///dev/nothing-here", "--set", f"stream.{name}={value}"))
    assert said.startswith(f'stream.{name} comes with gellight_ros, which is not installed: pip install "gellight[')
    assert f"[{extra}]" in said
    assert "\n" not in said


def test_what_the_distribution_names_is_there_and_is_what_the_settings_ask_for(monkeypatch: pytest.MonkeyPatch) -> None:
    project = tomllib.loads((CHECKOUT / "host/gellight_ros/pyproject.toml").read_text())["project"]
    points = [EntryPoint(name, place, GROUP) for name, place in project["entry-points"][GROUP].items()]
    monkeypatch.setattr(beside, "entry_points", lambda **_: points)
    assert bridges(load_settings({})) == []
    made = bridges(load_settings({f"stream.{name}": value for name, (value, _) in ASKED.items()}))
    assert {one.__name__ for one in made} == {"to_ros2", "to_foxglove"}
    assert len(points) == len(made)
