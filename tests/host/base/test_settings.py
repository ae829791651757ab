"""Settings: which source wins, and what is said about a mistake."""

import dataclasses
import json
import re
from math import isclose, radians
from pathlib import Path

import pytest

from gellight.base.errors import ConfigError
from gellight.base.settings import GeometrySettings, Settings, read_settings, reference
from gellight.bundle.bundle import Bundle, packed_bundle
from gellight.daemon.assembly import open_session
from gellight.sensor.sensor_camera import SensorCamera
from sim_reference.geometry import SensorGeometry
from tests.helpers.command_line import invoke, succeeded
from tests.helpers.doc_examples import examples
from tests.helpers.places import CHECKOUT
from tests.helpers.sensor_bench import Bench, lit_bundle
from tests.helpers.settings import loaded


@pytest.fixture
def folders(tmp_path: Path) -> dict[str, Path]:
    """An empty current folder and an empty user's configuration folder."""
    found = {"folder": tmp_path / "work", "user_folder": tmp_path / "user"}
    for folder in found.values():
        folder.mkdir()
    return found


def write(folders: dict[str, Path], text: str) -> Path:
    path = folders["folder"] / "gellight.toml"
    path.write_text(text)
    return path


def complaint(folders: dict[str, Path], text: str = "", environment: dict[str, str] | None = None) -> str:
    write(folders, text)
    with pytest.raises(ConfigError) as raised:
        loaded(environment=environment or {}, **folders)
    return str(raised.value)


def test_without_any_source_the_defaults_hold(folders: dict[str, Path]) -> None:
    settings = loaded(environment={}, **folders)
    assert settings == Settings()
    assert (settings.sensor.url, settings.dashboard.port, settings.geometry.overrides()) == ("auto", 8420, {})


def test_each_source_wins_over_the_weaker_ones(folders: dict[str, Path]) -> None:
    (folders["user_folder"] / "config.toml").write_text('[dashboard]\nport = 1\n[sensor]\nurl = "user"\n')
    assert loaded(environment={}, **folders).dashboard.port == 1
    write(folders, "[dashboard]\nport = 2\n")
    assert loaded(environment={}, **folders).dashboard.port == 2
    environment = {"GELLIGHT_DASHBOARD_PORT": "3"}
    assert loaded(environment=environment, **folders).dashboard.port == 3
    settings = loaded({"dashboard.port": 4, "sensor.url": None}, environment=environment, **folders)
    assert settings.dashboard.port == 4
    assert settings.sensor.url == "user", "a flag that was not given must not hide the file"


def test_environment_variables_are_read_as_what_the_key_wants(folders: dict[str, Path]) -> None:
    environment = {
        "GELLIGHT_RECONSTRUCTION_CAST_SHADOWS": "false",
        "GELLIGHT_GEOMETRY_PIXEL_SIZE_MM": "0.05",
        "GELLIGHT_SENSOR_CALIBRATION": "2024",
        "GELLIGHT_NO_SKIPS": "1",
        "HOME": "/",
    }
    settings = loaded(environment=environment, **folders)
    assert settings.reconstruction.cast_shadows is False
    assert settings.geometry.pixel_size_mm == 0.05
    assert settings.sensor.calibration == "2024"


@pytest.mark.parametrize(
    ("variable", "said"),
    [("GELLIGHT_STREEM_LAN", "did you mean stream?"), ("GELLIGHT_SENSOR", "choose one of url")],
)
def test_a_misspelt_environment_variable_is_refused(folders: dict[str, Path], variable: str, said: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(said)):
        loaded(environment={variable: "1"}, **folders)


def test_a_misspelt_key_names_file_and_the_key_that_was_meant(folders: dict[str, Path]) -> None:
    text = complaint(folders, "[dashboard]\nprot = 8000\n")
    assert text == f"{folders['folder'] / 'gellight.toml'}: unknown key dashboard.prot: did you mean port?"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (
            "[dashboard]\nport = 99999",
            "dashboard.port = 99999 is not allowed: give a whole number at least 0 and at most 65535",
        ),
        ("[dashboard]\nport = '8420'", "dashboard.port = '8420' is not allowed"),
        ("[dashboard]\nport = true", "dashboard.port = True is not allowed"),
        ("[reconstruction]\ncast_shadows = 1", "reconstruction.cast_shadows = 1 is not allowed: give true or false"),
        ("[geometry]\npixel_size_mm = 0", "geometry.pixel_size_mm = 0 is not allowed: give a number above 0"),
        ("[geometry]\ngel_diameter_mm = inf", "geometry.gel_diameter_mm = inf is not allowed"),
        ("[geometry]\npoisson_ratio = 0.5", "give a number at least 0 and below 0.5"),
        ("[geometry]\nled_colours = 'RGX'", "geometry.led_colours = 'RGX' is not allowed: give text like"),
        ("[sensor]\nurl = ''", "sensor.url = '' is not allowed"),
        ("sensor = 3", "sensor = 3 is no section: write [sensor]"),
        ("[reconstruction]\nzebra = 1", "choose one of mode, light_groups, frames_per_light, smoothing_px"),
        ("[dashbord]\nport = 1", "unknown section dashbord: did you mean dashboard?"),
        ("[dashboard", "is not TOML in UTF-8"),
        ("a = " + "[" * 20_000, "is not TOML in UTF-8"),
    ],
)
def test_a_wrong_value_is_named_with_what_is_allowed(folders: dict[str, Path], line: str, said: str) -> None:
    text = complaint(folders, line)
    assert text.startswith(str(folders["folder"] / "gellight.toml"))
    assert said in text


def test_every_mistake_of_a_file_is_reported_at_once_even_where_a_stronger_source_hides_it(
    folders: dict[str, Path],
) -> None:
    mistakes = "[dashboard]\nport = -1\n[reconstruction]\nsmoothing_px = -1\n"
    text = complaint(folders, mistakes, {"GELLIGHT_DASHBOARD_PORT": "8000"})
    assert "dashboard.port = -1" in text
    assert "reconstruction.smoothing_px = -1" in text


def test_a_wrong_environment_variable_and_a_wrong_flag_are_named(folders: dict[str, Path]) -> None:
    text = complaint(folders, environment={"GELLIGHT_DASHBOARD_PORT": "many"})
    assert text.startswith("environment variable GELLIGHT_DASHBOARD_PORT: dashboard.port = 'many' is not allowed")
    text = complaint(folders, environment={"GELLIGHT_DASHBOARD_PROT": "1"})
    assert "GELLIGHT_DASHBOARD_PROT: unknown key dashboard.prot: did you mean port?" in text
    with pytest.raises(ConfigError, match=r"^the command line: reconstruction\.smoothing_px = -1 is not allowed"):
        loaded({"reconstruction.smoothing_px": -1}, environment={}, **folders)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"there is no file .*lost\.toml: correct its name"):
        read_settings(tmp_path / "lost.toml")


def test_the_geometry_that_can_be_set_is_the_geometry_there_is_with_angles_in_radians() -> None:
    settable = {
        name.removesuffix("_deg") + "_rad" if name.endswith("_deg") else name for name in GeometrySettings.model_fields
    }
    assert settable == {field.name for field in dataclasses.fields(SensorGeometry)}
    overrides = GeometrySettings(incident_angle_deg=35.0, image_width_px=320, led_colours="RGBRGB").overrides()
    assert overrides.keys() == {"incident_angle_rad", "image_width_px", "led_colours"}
    geometry = SensorGeometry(**overrides)  # type: ignore[arg-type]
    assert isclose(geometry.incident_angle_rad, radians(35.0))
    assert (geometry.image_width_px, geometry.led_colours) == (320, "RGBRGB")


def test_the_documentation_names_every_section_and_no_key_that_is_not_there() -> None:
    _, _, tables = (CHECKOUT / "docs/configuration.md").read_text().partition("## All settings\n\n")
    rows = dict(re.findall(r"^\| `\[(\w+)\]` \| (.*) \|$", tables, re.MULTILINE))
    keys = {section: {setting.key for setting in reference() if setting.section == section} for section in rows}
    assert list(rows) == list(Settings.model_fields)
    for section, text in rows.items():
        assert set(re.findall(r"`(\w+)`", text)) <= keys[section]
    assert [setting.key for setting in reference() if not (setting.description and setting.allowed)] == []


@pytest.mark.parametrize("example", examples("docs/configuration.md", "toml"))
def test_every_example_of_the_documentation_is_accepted_and_opened(
    example: str, folders: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The camera it names is plugged into a computer made of nothing, its bundle lies where it says."""
    write(folders, example)
    settings = loaded(environment={}, **folders)
    bench = Bench(tmp_path / "computer")
    bench.plug("1-2", "GL0001")
    monkeypatch.chdir(tmp_path)

    def opened(url: str, bundle: Bundle) -> SensorCamera:
        assert url == "v4l2:///dev/video0", "the node of the sensor"
        return bench.open(url.replace("/dev", str(bench.usb.dev)), bundle)

    monkeypatch.setattr("gellight.sensor.sensor_camera.open_sensor", opened)
    Path(settings.sensor.calibration).parent.mkdir()
    Path(settings.sensor.calibration).write_bytes(packed_bundle(lit_bundle(tmp_path / "made")))
    with open_session(settings) as daemon:
        assert daemon.bundle.manifest.sensor == "GL0001"


class TestCommand:
    @pytest.fixture(autouse=True)
    def here(self, folders: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(folders["folder"])
        monkeypatch.setenv("XDG_CONFIG_HOME", str(folders["user_folder"]))
        monkeypatch.setenv("GELLIGHT_DASHBOARD_PORT", "8001")
        write(folders, "[reconstruction]\nsmoothing_px = 3\n")

    def run(self, *arguments: str) -> str:
        return succeeded(invoke("config", *arguments)).output

    def test_show_tells_values_and_where_they_come_from(self) -> None:
        text = self.run("show")
        assert "port = 8001  # environment variable GELLIGHT_DASHBOARD_PORT" in text
        assert "smoothing_px = 3  # " in text
        assert 'url = "auto"\n' in text

    def test_what_show_prints_can_be_read_back(self, folders: dict[str, Path]) -> None:
        write(folders, self.run("show"))
        assert loaded(environment={}, **folders).reconstruction.smoothing_px == 3

    def test_show_json(self) -> None:
        shown = json.loads(self.run("show", "--json"))
        assert shown["settings"]["dashboard"]["port"] == 8001
        assert shown["origins"]["dashboard.port"] == "environment variable GELLIGHT_DASHBOARD_PORT"
        assert sorted(shown["files"].values()) == [False, True]

    def test_schema_is_json_schema_of_all_sections(self) -> None:
        assert json.loads(self.run("show", "--schema"))["properties"].keys() == Settings.model_fields.keys()

    def test_show_marks_the_files_that_are_not_there(self, folders: dict[str, Path]) -> None:
        weak, strong = self.run("show").strip().splitlines()[-2:]
        assert weak.endswith("config.toml  (not there)")
        assert strong == f"# read: {folders['folder'] / 'gellight.toml'}"
