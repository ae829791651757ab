"""Words that no public name of the host has, and classes that are no namesakes: a reader must not guess which is meant.

The words are the private ones that reviews of the code could not read; beside each stands what the field says.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers.places import CHECKOUT

pytestmark = pytest.mark.style
HOST = CHECKOUT / "host/gellight"
OUT = {
    "upheld": "orthonormal",
    "telling": "informative",
    "sure": "certain",
    "knob": "control",
    "lent": "pool",
    "meant": "default",
    "usual": "default, typical",
    "sunken": "depth",
    "desk": "controller",
    "answering": "endpoint",
    "upholds": "keeps",
    "tells": "reports",
}
PHRASES = {
    "leave it away": "remove it",
    "that failed; the log says why": "internal error; see the log",
    "eyes that tell red from green": "colour-blind users",
    "take the virtual hand off": "untick the virtual hand",
    "name one of them": "pass one name",
}
NAMESAKES = {
    "Capability", "Identity", "Layer", "Level", "Light", "Mode", "Need", "Press", "Record",
    "Sensor", "State", "Status", "Target", "Trim", "Zero",
}  # fmt: skip
"""names that two classes still have; the list may only become shorter"""


def modules() -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted(HOST.rglob("*.py")):
        yield path, ast.parse(path.read_text())


def public_names() -> Iterator[tuple[Path, str]]:
    for path, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                yield path, node.name


def words_of(name: str) -> set[str]:
    """Return the words of a snake_case or CamelCase name."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+", name)}


def test_no_public_name_has_a_word_that_is_out() -> None:
    names = list(public_names())
    assert len(names) > 2000
    found = [(name, path, OUT[word]) for path, name in names for word in words_of(name) & set(OUT)]
    assert found == []


def test_no_text_has_a_phrase_that_is_out() -> None:
    texts = [path for suffix in ("py", "js", "html") for path in HOST.rglob(f"*.{suffix}")]
    found = [(path, phrase, say) for path in texts for phrase, say in PHRASES.items() if phrase in path.read_text()]
    assert found == []


def test_no_two_public_classes_have_one_name() -> None:
    homes = defaultdict(list)
    for path, tree in modules():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(path.relative_to(HOST))
    assert {name for name, places in homes.items() if len(places) > 1} == NAMESAKES
