"""Build and run the fuzzers: `python tests/firmware/helpers/fuzzing.py SECONDS [SEED [control|flash]]` for a long run.

The core gets stories (firmware/fuzz/target.c), endpoint 0 of the USB device control transfers (firmware/fuzz/control),
the configuration records that were spoilt and saves that lose power (firmware/fuzz/flash).

libFuzzer where clang has it, firmware/fuzz/driver.c where not: both are guided by coverage, and change stories by
firmware/fuzz/mutator.c. Inputs that reach new code are added to build/fuzz. With `--keep` in place of SECONDS,
firmware/fuzz/corpus becomes a small set of inputs that reaches all that it and build/fuzz reached.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

CHECKOUT = Path(__file__).parents[3]
CORPUS = CHECKOUT / "firmware/fuzz/corpus"
NEW = CHECKOUT / "build/fuzz"
INPUT_BYTES = 1024
FLAGS = ["-std=c11", "-g", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fno-sanitize-recover=all"]


class Fuzzer(NamedTuple):
    """A fuzzer that was built; `engine` is `libFuzzer` or `driver`."""

    program: Path
    engine: str


class _Sources(NamedTuple):
    """What a fuzzer is made of: flags of the compiler, what is looked into for new code, and the rest."""

    flags: list[str]
    looked_into: list[str]
    rest: list[str]


def _sources(checkout: Path, what: str) -> _Sources:
    firmware = checkout / "firmware"
    if what == "control":  # the device's source casts its 32-bit addresses to pointers
        folders = [firmware / "fuzz/control", firmware / "boards/rp2", firmware / "boards/rp2040", firmware / "core"]
        files = [folders[1] / name for name in ("usb_control.c", "usb_descriptors.c")]
        flags, rest = ["-D_DEFAULT_SOURCE", "-Wno-int-to-pointer-cast"], [folders[0] / "target.c"]
    elif what == "flash":
        folders = [firmware / "fuzz/flash", firmware / "core"]
        flags, files, rest = [], [folders[1] / "config.c"], [folders[0] / "target.c", folders[1] / "crc.c"]
    else:
        folders = [firmware / name for name in ("core", "fuzz", "boards/host")]
        flags = ["-DBOARD_LIGHTS=16u", "-DBOARD_OUTPUT_BYTES=16384u"]  # clearing more is most of the time
        everything = [file for folder in folders for file in sorted(folder.glob("*.c")) if file.name != "driver.c"]
        files = [file for file in everything if file.parent == folders[0] and file.name != "crc.c"]
        rest = [file for file in everything if file not in files]  # a checksum goes the same way for all bytes
    return _Sources([*flags, *(f"-I{folder}" for folder in folders)], [*map(str, files)], [*map(str, rest)])


def compile_fuzzer(target: Path, checkout: Path = CHECKOUT, *, what: str = "core") -> Fuzzer:
    """Build the fuzzer of the `core`, `control` transfers or the `flash`, under the sanitizers at hand."""
    clang, found = shutil.which("clang"), shutil.which("gcc") or shutil.which("cc")
    sources = _sources(checkout, what)
    if clang:
        sanitize = "-fsanitize=fuzzer,address,undefined"
        command = [clang, *FLAGS, *sources.flags, sanitize, *sources.looked_into, *sources.rest, "-o", str(target)]
        done = subprocess.run(command, capture_output=True, check=False)
        if done.returncode == 0:
            return Fuzzer(target, "libFuzzer")
    compiler = [found] if found else [sys.executable, "-m", "ziglang", "cc"]
    sanitize = f"-fsanitize={'address,undefined' if found else 'undefined'}"  # ziglang comes without ASan
    with tempfile.TemporaryDirectory() as objects:
        driver = checkout / "firmware/fuzz/driver.c"
        covered = [sanitize, "-fsanitize-coverage=trace-pc", *sources.looked_into]
        for part in ([str(driver)], covered):
            subprocess.run([*compiler, *FLAGS, *sources.flags, "-c", *part], cwd=objects, check=True)
        made = [str(path) for path in sorted(Path(objects).glob("*.o"))]
        command = [*compiler, *FLAGS, *sources.flags, sanitize, *sources.rest, *made, "-o", str(target)]
        subprocess.run(command, check=True)
    return Fuzzer(target, "driver")


def fuzz(
    fuzzer: Fuzzer, seconds: int, seed: int, folder: str = "-", *, corpus: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run it, starting from the corpus (that of the core); what reaches new code goes to the folder."""
    files = [str(file) for file in sorted(CORPUS.glob("*.bin"))] if corpus else []
    command = [str(fuzzer.program), str(seconds), str(seed), folder, *files]
    if fuzzer.engine == "libFuzzer":
        NEW.mkdir(parents=True, exist_ok=True)
        command = [str(fuzzer.program), f"-max_total_time={seconds}", f"-seed={seed}", f"-max_len={INPUT_BYTES}",
                   f"-artifact_prefix={NEW.parent}/"]  # fmt: skip
        if corpus:
            command += [str(NEW) if folder == "-" else folder, str(CORPUS)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def keep(fuzzer: Fuzzer) -> int:
    """Make the corpus the inputs, short ones first, that add something to those before; return how many there are."""
    files = sorted([*CORPUS.glob("*"), *NEW.glob("*")], key=lambda file: (file.stat().st_size, file.read_bytes()))
    with tempfile.TemporaryDirectory() as folder:
        command = [str(fuzzer.program), "0", "1", folder, *map(str, files)]
        subprocess.run(command, check=True, capture_output=True)
        kept = sorted(Path(folder).glob("*.bin"))
        for file in CORPUS.glob("*.bin"):
            file.unlink()
        for number, file in enumerate(kept):
            shutil.copy(file, CORPUS / f"{number:03}.bin")
    return len(kept)


def main() -> int:
    NEW.mkdir(parents=True, exist_ok=True)
    given = dict(enumerate(sys.argv[1:]))
    seconds, seed, what = given[0], given.get(1, "1"), given.get(2, "core")
    with tempfile.TemporaryDirectory() as scratch:
        fuzzer = compile_fuzzer(Path(scratch) / "fuzzer", what=what)
        if seconds == "--keep":
            print(f"{keep(fuzzer)} inputs in {CORPUS}")
            return 0
        core = what == "core"
        done = fuzz(fuzzer, int(seconds), int(seed), str(NEW) if core else "-", corpus=core)
    print(fuzzer.engine, done.stdout, done.stderr[-3000:], sep="\n")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
