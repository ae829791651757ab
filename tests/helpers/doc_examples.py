"""The programs in the documents, as a reader would run them."""

import re

from tests.helpers.places import CHECKOUT


def examples(document: str) -> list[str]:
    """Return the python blocks of a document such as docs/capture.md, in their order."""
    return re.findall(r"```python\n(.*?)```", (CHECKOUT / document).read_text(), re.DOTALL)


def run(code: str, document: str) -> dict[str, object]:
    """Run a program in this process; return its names."""
    names: dict[str, object] = {"__name__": "__main__"}
    exec(compile(code, document, "exec"), names)
    return names
