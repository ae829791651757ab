"""What is told: the JSON log, and a package that is missing."""

import json
import logging
from collections.abc import Iterator
from datetime import datetime

import pytest

from gellight.base import logs
from gellight.base.errors import InputError, needed
from tests.helpers import children

KEYS = {"time", "level", "logger", "process", "sensor", "message"}


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    root, own = logging.getLogger(), logging.getLogger("gellight")
    handlers, level, own_level = root.handlers[:], root.level, own.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)
    own.setLevel(own_level)


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_every_line_is_an_object_with_its_time_sensor_and_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("json", "sensor://GL0001")
    logging.getLogger("gellight.daemon").warning("%s of\n%d", 'a "part"', 3)
    logging.getLogger("aiohttp.server").info("said by a library, and not kept")
    logs.say("dashboard: http://127.0.0.1:8420/")
    warned, said = lines(capsys)
    assert set(warned) == KEYS
    assert (warned["level"], warned["logger"], warned["sensor"]) == ("warning", "gellight.daemon", "sensor://GL0001")
    assert warned["message"] == 'a "part" of\n3'
    assert abs(datetime.fromisoformat(str(warned["time"])).timestamp() - datetime.now().timestamp()) < 60
    assert (said["level"], said["message"]) == ("info", "dashboard: http://127.0.0.1:8420/")
    try:
        raise ValueError("odd")
    except ValueError:
        logging.getLogger("gellight.x").exception("it failed")
    (line,) = lines(capsys)
    assert line["level"] == "error"
    assert "ValueError: odd" in str(line["exception"])


def test_as_text_nothing_is_changed(capsys: pytest.CaptureFixture[str]) -> None:
    before = logging.getLogger().handlers[:]
    logs.configure("text", "sim://")
    logs.say("a line")
    assert logging.getLogger().handlers == before
    assert capsys.readouterr().err == "a line\n"


def test_a_run_logs_json_from_its_first_word_to_its_error(tmp_path) -> None:  # type: ignore[no-untyped-def]
    run = children.gellight(
        "run", "--sensor", "sim://?board=0", "--frames", "2", "--set", "service.log=json", "--json", check=True
    )
    said = [json.loads(line)["message"] for line in run.stderr.splitlines()]
    assert any(text.startswith("dashboard: ") for text in said)
    assert any(text.startswith("publishing: ") for text in said)
    refused = children.gellight("run", "--sensor", str(tmp_path / "nothing"), "--set", "service.log=json")
    assert refused.returncode == 2
    (line,) = [json.loads(text) for text in refused.stderr.splitlines()]
    assert line["level"] == "error"
    assert line["message"].startswith("gellight: ")


# ---- a package that is missing is told from one that does not load ----


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ModuleNotFoundError("No module named 'h5py'"), "pip install this"),
        (ImportError("lib.so: failed to map segment"), "cannot be loaded: lib.so: failed to map segment"),
    ],
)
def test_only_a_missing_package_is_to_be_installed(error: ImportError, told: str) -> None:
    with pytest.raises(InputError, match=told), needed("pip install this"):
        raise error
