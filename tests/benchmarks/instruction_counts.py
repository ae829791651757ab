"""Instructions of a frame in C: `python -m tests.benchmarks.instruction_counts`, in QEMU's user mode (7 or 8).

The scenes of `frame_times` at 640 x 480, on aarch64 with NEON and on x86-64 without AVX, both with vectors of four
numbers. Who has a processor of the first kind learns from the ratio what a frame costs there, at as many instructions a
second. With the copies of arrays to and from the emulator, some per cent of them.
"""

import struct
import subprocess
import tempfile
from pathlib import Path

from gellight.bundle.bundle import load_bundle
from gellight.frame_path import pipeline
from gellight.frames.frames import CameraFrame
from gellight.reconstruction.native import build
from tests.benchmarks.frame_times import scenes
from tests.helpers.other_processor import OtherProcessor, build_server

PLUGIN = Path(__file__).parents[1] / "helpers/count_instructions.c"
LIBRARIES = {"aarch64": "aarch64", "x86_64": "x86_64-v2"}


def counted(folder: Path, processor: str) -> dict[str, int]:
    """Return the instructions of a frame of each scene."""
    plugin, count = folder / "count.so", folder / processor
    count.write_bytes(bytes(8))
    subprocess.run(["gcc", "-O1", "-shared", "-fPIC", PLUGIN, "-o", plugin], check=True)
    found, bundle = {}, load_bundle("synthetic")
    options = ["-plugin", f"{plugin},count={count}"]
    server = build_server(folder, processor)
    with OtherProcessor(build.library_file(LIBRARIES[processor]), server, processor, options) as emulated:
        pipeline.fitting_library = lambda: (processor, emulated)
        reconstructor = pipeline.Reconstructor(bundle)
        for scene, image in scenes(bundle).items():
            before = struct.unpack("<Q", count.read_bytes())[0]
            reconstructor.reconstruct(CameraFrame(image=image, time_s=0.0, sequence=0))
            found[scene] = struct.unpack("<Q", count.read_bytes())[0] - before
    return found


def main() -> None:
    """Print a line for each scene."""
    with tempfile.TemporaryDirectory() as folder:
        arm, plain = (counted(Path(folder), processor) for processor in LIBRARIES)
    for scene, count in arm.items():
        print(
            f"{scene:20} aarch64 {count / 1e6:7.1f} million, x86-64 without AVX {plain[scene] / 1e6:7.1f} million: "
            f"{count / plain[scene]:.2f}"
        )


if __name__ == "__main__":
    main()
