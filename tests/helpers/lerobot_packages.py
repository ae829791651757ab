"""LeRobot for its tests, in a cache folder of its own: fetched once, never installed.

It cannot be in the environment of the other tests: it wants other versions of PyTorch and OpenCV, and its package
draccus brings a folder called `tests`. Its cameras and robots need neither of the first two. It asks for Python 3.12;
for older ones the few statements that only 3.12 reads are rewritten, which changes no behaviour.
"""

import hashlib
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

LEROBOT = ("lerobot==0.6.1",)
"""the newest there was; without what it depends on"""
NEEDED = ("draccus==0.11.6", "huggingface-hub>=1.6,<2", "pillow>=10")
NEW_SYNTAX = {"lerobot/motors": (r"(?m)^type (\w+) = ", r"\1 = ")}


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
    """Fetch the packages."""
    install = (sys.executable, "-m", "pip", "install", "--quiet", "--target", str(folder))
    for options in (("--no-deps", "--ignore-requires-python", *LEROBOT), NEEDED):
        done = subprocess.run([*install, *options], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"LeRobot cannot be fetched, which its tests need once: {done.stderr.strip()[-500:]}")
    if sys.version_info < (3, 12):
        for part, (old, new) in NEW_SYNTAX.items():
            for path in (folder / part).glob("*.py"):
                path.write_text(re.sub(old, new, path.read_text()))
