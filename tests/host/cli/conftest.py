"""Pictures of presses, and the bundle that was learnt from them: several files of tests read both."""

from pathlib import Path

import pytest

from tests.helpers.command_line import succeeded
from tests.helpers.made_once import made_once
from tests.helpers.pressed_pictures import press_into, run, sources


@pytest.fixture(scope="session")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return press_into(tmp_path_factory.mktemp("pressed"))


@pytest.fixture(scope="session")
def bundle(pressed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def fit(folder: Path) -> None:
        (folder / "bundles").mkdir(exist_ok=True)
        options = ["--recipe", "fast", "--width", "16", "--sensor", "S1"]
        succeeded(run("fit", *sources(pressed), "--out", folder / "bundles/sensor", *options))

    return made_once(tmp_path_factory, "fitted", fit) / "bundles/sensor"
