"""The programs in the documents, as a reader would run them."""

import re

from tests.helpers.places import CHECKOUT


def examples(document: str, language: str = "python") -> list[str]:
    """Return the blocks of a language of a document such as docs/capture.md, in their order."""
    return re.findall(rf"```{language}\n(.*?)```", (CHECKOUT / document).read_text(), re.DOTALL)


def run(code: str, document: str, names: dict[str, object] | None = None) -> dict[str, object]:
    """Run a program in this process, after others if their `names` are given; return its names."""
    names = {"__name__": "__main__"} if names is None else names
    exec(compile(code, document, "exec"), names)
    return names
