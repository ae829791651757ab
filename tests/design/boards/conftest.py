"""The boards of the default sensor as the verb writes them."""

from pathlib import Path

import pytest

from gellight_design.boards.files import board_files
from sim_reference.geometry import SensorGeometry
from tests.helpers.boards import write_files


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("boards")
    write_files(folder, board_files(SensorGeometry(), "pico", "5050"))
    return folder
