"""Build and run the fuzzer of the core: `python tests/firmware/helpers/fuzzing.py SECONDS [SEED]` for a long run.

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
FLAGS = ["-std=c11", "-g", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-fno-sanitize-recover=all"]


class Fuzzer(NamedTuple):
    """A fuzzer that was built; `engine` is `libFuzzer` or `driver`."""

    program: Path
    engine: str


def _command(compiler: list[str], checkout: Path, target: Path, *flags: str) -> list[str]:
    folders = [checkout / "firmware" / name for name in ("fuzz", "boards/host", "core")]
    files = [file for folder in folders for file in sorted(folder.glob("*.c")) if file.name != "driver.c"]
    includes = [f"-I{folder}" for folder in folders]
    return [*compiler, *FLAGS, *flags, *includes, *map(str, files), "-o", str(target)]


def compile_fuzzer(target: Path, checkout: Path = CHECKOUT) -> Fuzzer:
    """Build it under the sanitizers of the compiler at hand."""
    clang, found = shutil.which("clang"), shutil.which("gcc") or shutil.which("cc")
    if clang:
        command = _command([clang], checkout, target, "-fsanitize=fuzzer,address,undefined")
        done = subprocess.run(command, capture_output=True, check=False)
        if done.returncode == 0:
            return Fuzzer(target, "libFuzzer")
    compiler = [found] if found else [sys.executable, "-m", "ziglang", "cc"]
    sanitizers = "address,undefined" if found else "undefined"  # ziglang comes without ASan
    driver = target.with_suffix(".o")  # by itself: it is not what is looked into
    source = checkout / "firmware/fuzz/driver.c"
    subprocess.run([*compiler, *FLAGS, "-O2", "-c", str(source), "-o", str(driver)], check=True)
    flags = [f"-fsanitize={sanitizers}", "-fsanitize-coverage=trace-pc", str(driver)]
    subprocess.run(_command(compiler, checkout, target, *flags), check=True)
    return Fuzzer(target, "driver")


def fuzz(fuzzer: Fuzzer, seconds: int, seed: int, folder: str = "-") -> subprocess.CompletedProcess[str]:
    """Run it, starting from the corpus; what reaches new code goes to the folder."""
    files = [str(file) for file in sorted(CORPUS.glob("*.bin"))]
    command = [str(fuzzer.program), str(seconds), str(seed), folder, *files]
    if fuzzer.engine == "libFuzzer":
        NEW.mkdir(parents=True, exist_ok=True)
        command = [str(fuzzer.program), f"-max_total_time={seconds}", f"-seed={seed}", f"-max_len={INPUT_BYTES}",
                   f"-artifact_prefix={NEW.parent}/"]  # fmt: skip
        command += [str(NEW), str(CORPUS)] if folder == "-" else [folder, str(CORPUS)]
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
    with tempfile.TemporaryDirectory() as scratch:
        fuzzer = compile_fuzzer(Path(scratch) / "fuzzer")
        if sys.argv[1] == "--keep":
            print(f"{keep(fuzzer)} inputs in {CORPUS}")
            return 0
        done = fuzz(fuzzer, int(sys.argv[1]), int((sys.argv[2:] or ["1"])[0]), str(NEW))
    print(fuzzer.engine, done.stdout, done.stderr[-3000:], sep="\n")
    return done.returncode


if __name__ == "__main__":
    sys.exit(main())
