"""LeRobot and the plug-in for their tests, in folders of their own: fetched or built once, never installed.

It cannot be in the environment of the other tests: it wants other versions of PyTorch and OpenCV, and its package
draccus brings a folder called `tests`. Its cameras and robots need neither of the first two. It asks for Python 3.12;
for older ones the statements that only 3.12 reads are rewritten, which changes no behaviour.
"""

import hashlib
import os
import re
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from tests.helpers.places import CHECKOUT

LEROBOT = (
    "lerobot==0.6.1", "datasets", "dill", "einops", "jsonlines", "multiprocess", "pandas", "python-dateutil",
    "safetensors", "six", "xxhash",
)  # fmt: skip
"""the newest there was; without what they depend on"""
NEEDED = ("draccus==0.11.6", "huggingface-hub>=1.6,<2", "pillow>=10")
NEW_SYNTAX = (
    (r"(?m)^type (\w+) = ", r"\1 = "),
    (r"(?m)^(\s*(?:async )?(?:def|class) \w+)\[[^\]]*\]", r"\1"),
)
PLUGIN = CHECKOUT / "host/lerobot_camera_gellight"


def lerobot_environment(folder: Path) -> dict[str, str]:
    """Return where LeRobot and the plug-in, built in `folder`, are imported from, and where LeRobot may write."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder / "wheel"]
    subprocess.run(build, cwd=PLUGIN, check=True)
    (wheel,) = (folder / "wheel").glob("*.whl")
    zipfile.ZipFile(wheel).extractall(folder / "site")
    path = os.pathsep.join(map(str, (folder / "site", lerobot_folder(), CHECKOUT / "host")))
    return {**os.environ, "PYTHONPATH": path, "HF_HOME": str(folder / "hf"), "HF_HUB_OFFLINE": "1"}


def lerobot_folder() -> Path:
    """Return the folder for PYTHONPATH, made now if it is not there; raises with pip's words where that fails."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    digest = hashlib.sha256(repr((LEROBOT, NEEDED, NEW_SYNTAX, version)).encode()).hexdigest()[:16]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gellight" / "lerobot"
    folder = cache / digest
    if not folder.exists():
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache) as draft:
            fetch(Path(draft) / "all")
            if not folder.exists():  # another process may have been faster
                (Path(draft) / "all").rename(folder)
    return folder


def fetch(folder: Path) -> None:
    install = (sys.executable, "-m", "pip", "install", "--quiet", "--target", str(folder))
    for options in (("--no-deps", "--ignore-requires-python", *LEROBOT), NEEDED):
        done = subprocess.run([*install, *options], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"LeRobot cannot be fetched, which its tests need once: {done.stderr.strip()[-500:]}")
    if sys.version_info < (3, 12):
        for path in (folder / "lerobot").rglob("*.py"):
            content = path.read_text()
            for old, new in NEW_SYNTAX:
                content = re.sub(old, new, content)
            if content != path.read_text():
                path.write_text(f"from __future__ import annotations\n{content}")
