"""The first hour: what README.md says, word by word, in a fresh clone and in a fresh environment with the wheel.

Every shell block of README.md is typed line by line into one shell, as a newcomer would. `INSTEAD` says where something
else is typed: what runs until Ctrl-C gets an end, and what needs a sensor and a hand gets simulated ones.
"""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.helpers.children import run
from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.nightly

README = (CHECKOUT / "README.md").read_text()
CLONE = "git clone REPOSITORY_ADDRESS gellight && cd gellight"
"""the one place that a release gives its address"""
SIMULATED = "'sim://?board=0'"
INSTEAD = {
    CLONE: "true",
    "make demo": "make demo ARGS='--frames 30 --json'",
    "gellight calibrate": f"gellight calibrate --auto --sensor {SIMULATED} --presses 10 --verifications 2 "
    "--recipe fast --largest-depth-error-um 400 --largest-normal-error-deg 20",
    "gellight run": f"gellight run --frames 10 --sensor {SIMULATED} --calibration auto",
    # A rule of this computer is not for a test to change.
    "sudo $(command -v gellight) install-udev": "$(command -v gellight) install-udev --print",
}
"""what is typed for a line: sensor and hand are simulated, and few presses are enough to see that all fits"""
STATUS = {"gellight doctor": (0, 1)}
"""1 where something prevents use, as here: no sensor is plugged in"""


@dataclass(frozen=True)
class Line:
    """One command of README.md, and what is typed for it."""

    command: str
    typed: str
    statuses: tuple[int, ...]


def lines() -> list[Line]:
    """Return every command in the shell blocks of README.md."""
    found = []
    for block in re.findall(r"```(?:sh|bash|shell)\n(.*?)```", README, re.DOTALL):
        for text in block.replace("\\\n", " ").splitlines():
            command = re.sub(r"\s+#.*", "", text).strip()
            if command:
                found.append(Line(command, INSTEAD.get(command, command), STATUS.get(command, (0,))))
    return found


def pythons() -> list[str]:
    """Return every Python of this machine that GelLight supports, the oldest first; the running one at least."""
    found = {f"{sys.version_info.major}.{sys.version_info.minor}": sys.executable}
    known = [*Path.home().glob(".pyenv/versions/*/bin/python3"), *map(Path, filter(None, map(shutil.which, NAMES)))]
    for path in known:
        asked = run([path, "-c", "import sys, venv, ensurepip; print('%d.%d' % sys.version_info[:2])"])
        version = asked.stdout.strip()
        if asked.returncode == 0 and tuple(map(int, version.split("."))) >= (3, 11):
            found.setdefault(version, str(path))
    return [found[version] for version in sorted(found, key=lambda text: tuple(map(int, text.split("."))))]


NAMES = [f"python3.{minor}" for minor in range(11, 20)]


def environment(place: Path) -> dict[str, str]:
    """Return the environment of a newcomer: nothing of this checkout, a home of its own."""
    own = ("PYTHONPATH", "VIRTUAL_ENV", "PYTHONDONTWRITEBYTECODE")
    kept = {name: value for name, value in os.environ.items() if name not in own}
    kept = {name: value for name, value in kept.items() if not name.startswith("GELLIGHT_")}
    programs = Path(sys.executable).parent
    path = os.pathsep.join(folder for folder in kept["PATH"].split(os.pathsep) if Path(folder) != programs)
    homes = {f"XDG_{kind}_HOME": str(place / kind.lower()) for kind in ("CONFIG", "DATA", "STATE")}
    # pip would compile 5000 modules, two thirds of its processor time; Python compiles those that are used.
    return {**kept, **homes, "PATH": path, "PIP_COMPILE": "0"}


def typed(commands: list[Line], folder: Path, place: Path, before: str = "") -> str:
    """Type commands into one shell, and return all it printed; fails at the first that ends with another status."""
    script = ["set -u", before]
    for line in commands:
        allowed = "|".join(map(str, line.statuses))
        script += [f"echo '>>> '{_quoted(line.command)}", line.typed]
        script += [f'status=$?; case $status in {allowed}) ;; *) echo "ended with $status"; exit 99;; esac']
    done = run(
        ["bash", "-c", "\n".join(script)], cwd=folder, env=environment(place), stderr=subprocess.STDOUT, timeout_s=1500
    )
    assert done.returncode == 0, done.stdout[-5000:]
    return str(done.stdout)


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def check_program(program: Path, place: Path) -> None:
    for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL):
        done = run([program, "-c", block], cwd=place, env=environment(place))
        assert done.returncode == 0, done.stderr
        assert "mm deep" in done.stdout


def cloned(place: Path) -> Path:
    """Return a clone with what is changed in this checkout: what a newcomer gets after the next commit."""
    folder = place / "gellight"
    listed = run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=CHECKOUT, check=True
    ).stdout
    for name in filter(None, listed.split("\0")):
        if (CHECKOUT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(CHECKOUT / name, folder / name)
    return folder


@pytest.mark.timeout(1800)
def test_the_first_hour_in_a_fresh_clone(tmp_path: Path) -> None:
    folder = cloned(tmp_path)
    shown = typed(lines(), folder, tmp_path, f"export PYTHON={sys.executable}")
    assert ". .venv/bin/activate" in shown.split(">>> ")[2], "`make demo` says how to get the command"
    assert "it is in service" in shown


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("wheel")
    run([sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", place, cloned(place)], check=True)
    return next(place.glob("*.whl"))


@pytest.mark.timeout(1800)
def test_the_first_hour_with_the_wheel(wheel: Path, tmp_path: Path) -> None:
    """As README.md says for an environment of one's own, with the newest Python of this machine.

    What needs a checkout, and the calibration, which is tried in the clone, are not typed.
    """
    run([pythons()[-1], "-m", "venv", tmp_path / "env"], check=True)
    program = tmp_path / "env/bin/python"
    run([program, "-m", "pip", "install", "--quiet", wheel], check=True, timeout_s=1500, env=environment(tmp_path))
    left_out = ("git clone", "make", ". .venv", "gellight calibrate", "gellight run")
    there = [line for line in lines() if not line.command.startswith(left_out)]
    typed(there, tmp_path, tmp_path, f". {tmp_path}/env/bin/activate")
    check_program(program, tmp_path)
    installed = next((tmp_path / "env").glob("lib/python*/site-packages"))
    for package in ("gellight", "gelnet", "sim_reference"):
        assert (installed / package / "py.typed").is_file()


def test_every_command_that_needs_a_sensor_is_known_here() -> None:
    known = [line.command for line in lines()]
    assert known[:2] == [CLONE, "make demo"]
    assert {*INSTEAD, *STATUS} <= set(known)


def test_the_address_of_the_repository_is_set_in_one_place() -> None:
    pages = (path for path in CHECKOUT.rglob("*.md") if not {".venv", "build", "shared"} & {*path.parts})
    assert [path.name for path in pages for _ in range(path.read_text().count("REPOSITORY_ADDRESS"))] == ["README.md"]
