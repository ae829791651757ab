"""Build and run the fuzzer of the core: `python tests/firmware/fuzzing.py SECONDS [SEED]` for a long run.

Inputs that reach new code are added to build/fuzz; worthwhile ones belong into firmware/fuzz/corpus. Where clang has
libFuzzer, the same target builds with `-fsanitize=fuzzer` and without driver.c.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
CORPUS = CHECKOUT / "firmware/fuzz/corpus"


def compile_fuzzer(target: Path, checkout: Path = CHECKOUT) -> Path:
    found = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    compiler = [found] if found else [sys.executable, "-m", "ziglang", "cc"]
    sanitizers = "address,undefined" if found else "undefined"  # ziglang comes without ASan
    folders = [checkout / "firmware" / name for name in ("fuzz", "boards/host", "core")]
    files = [str(file) for folder in folders for file in sorted(folder.glob("*.c"))]
    flags = ["-std=c11", "-g", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-fsanitize={sanitizers}",
             "-fno-sanitize-recover=all", "-fsanitize-coverage=trace-pc"]  # fmt: skip
    command = [*compiler, *flags, *(f"-I{folder}" for folder in folders), *files, "-o", str(target)]
    subprocess.run(command, check=True)
    return target


def fuzz(fuzzer: Path, seconds: int, seed: int, folder: str = "-") -> subprocess.CompletedProcess[str]:
    files = [str(file) for file in sorted(CORPUS.glob("*.bin"))]
    return subprocess.run(
        [str(fuzzer), str(seconds), str(seed), folder, *files], capture_output=True, text=True, check=False
    )


if __name__ == "__main__":
    new = CHECKOUT / "build/fuzz"
    new.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        done = fuzz(
            compile_fuzzer(Path(scratch) / "fuzzer"), int(sys.argv[1]), int((sys.argv[2:] or ["1"])[0]), str(new)
        )
    print(done.stdout, done.stderr, sep="")
    sys.exit(done.returncode)
