"""Step 7: the computer sleeps. The ring is dark meanwhile, and answers when it wakes."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable

import numpy as np
import pytest

from gellight.base.errors import BoardError
from gellight.ring.enumerations import Dark
from gellight.ring.light_ring import LightRing

pytestmark = pytest.mark.hardware
SLEEP_S = 10


def sleep(ask: Callable[[str], str]) -> None:
    """Let the computer sleep for a while, by itself where that is allowed."""
    ask("The computer is going to sleep. Look at the LEDs meanwhile. Press Enter.")
    if shutil.which("rtcwake") and os.geteuid() == 0:
        subprocess.run(["rtcwake", "-m", "mem", "-s", str(SLEEP_S)], check=True)
    else:
        ask(f"Close the lid for {SLEEP_S} s, open it, and press Enter.")


def test_the_port_works_on_after_a_sleep(
    ring: LightRing, dim: np.ndarray, ask: Callable[[str], str], reopened: Callable[[], LightRing]
) -> None:
    ring.light(dim)
    sleep(ask)
    assert ask("Were the LEDs dark while the computer slept? [y/n]") == "y"
    time.sleep(1)
    try:
        status = ring.status()
    except BoardError:  # some computers take the power away: then the port is a new one
        ring.transport.close()
        with reopened() as again:
            assert again.status().dark in (Dark.BOOT, Dark.COMMAND)
        return
    assert status.dark in (Dark.SUSPENDED, Dark.NOT_DARK, Dark.PORT_CLOSED)
