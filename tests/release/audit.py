"""Ask whether the pinned packages have known weaknesses: `python -m tests.release.audit`.

pip-audit asks the package index, so it needs a network. Ends with 0 where none is known, 1 where one is, 3 where
nothing could be asked.
"""

import re
import subprocess
import sys

from tests.release.sbom import PINNED

NOT_AUDITED = 3
AUDIT = (sys.executable, "-m", "pip_audit", "--disable-pip", "--require-hashes", "--progress-spinner", "off")


def main() -> int:
    """Run pip-audit; say it loudly where it could not ask."""
    done = subprocess.run([*AUDIT, "-r", PINNED, "--timeout", "15"], capture_output=True, text=True, check=False)
    if done.returncode == 0 or re.search(r"Found \d+ known", done.stderr):
        print(done.stdout, done.stderr, sep="")
        return done.returncode
    print(f"NOT AUDITED: {PINNED.name} was compared with no list of weaknesses; do it with a network before a release.")
    print("pip-audit said:", (done.stderr.splitlines() or ["nothing"])[-1])
    return NOT_AUDITED


if __name__ == "__main__":
    sys.exit(main())
