"""Settings as they are in another environment, current folder and user's configuration folder."""

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from unittest.mock import patch

from gellight.base.settings import Settings, load_settings

NOWHERE = Path("/")


def loaded(
    flags: Mapping[str, object] | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    folder: Path = NOWHERE,
    user_folder: Path = NOWHERE,
) -> Settings:
    """The settings there; without arguments no file and no variable says anything."""
    with (
        patch.dict(os.environ, environment or {}, clear=True),
        patch("platformdirs.user_config_path", return_value=user_folder),
        contextlib.chdir(folder),
    ):
        return load_settings(flags)
