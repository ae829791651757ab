"""What the documents say can be typed, and their links lead somewhere."""

import json
import re
import shlex
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.main import get_command

import gellight
from gellight.cli.main import app
from tests.helpers.command_line import verbs
from tests.helpers.places import CHECKOUT as ROOT


def test_every_file_the_documents_link_to_is_there() -> None:
    for document in (ROOT / "README.md", *ROOT.glob("docs/*.md"), ROOT / "models/README.md"):
        for link in re.findall(r"\]\((?!https?:)([^)#]+)", document.read_text()):
            assert (document.parent / link).exists(), f"{document.name} links to {link}"


def commands(text: str) -> Iterator[tuple[str, bool]]:
    """Yield what a document says after `gellight`, and whether a user can type it as it stands."""
    for block in re.findall(r"^```[^\n]*\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        for line in block.replace("\\\n", " ").splitlines():
            found = re.match(r"\s*(?:\$ |sudo |\.venv/bin/)*gellight(?=\s)(.*)", line)
            if found:
                yield found[1], "..." not in found[1]
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    for words in re.findall(r"`(?:sudo )?gellight((?:\s[^`]*)?)`", prose):
        yield words, False


def parse(text: str, complete: bool) -> None:
    """Parse all words after `gellight` as the command line does, without running anything.

    complete: also demand what a verb cannot do without. Raises typer's errors.
    """
    lexer = shlex.shlex(text, posix=True, punctuation_chars="|&;<>")
    lexer.whitespace_split = True
    words = list(takewhile(lambda word: not set(word) <= set("|&;<>"), lexer))
    if words and words[-1] == "..." and not words[-2].startswith("--"):
        words.pop()  # it stands for more options, not for the value of the last one
    command = get_command(app)
    context: Any = None
    try:
        context = command.make_context("gellight", words)
        while context._protected_args:
            group, rest = context.command, [*context._protected_args, *context.args]
            name, verb, rest = group.resolve_command(context, rest)
            context = verb.make_context(name, rest, parent=context)
    except typer.BadParameter as error:
        if complete or type(error).__name__ != "MissingParameter":
            raise
    except UsageError as error:
        if complete or type(error).__name__ != "NoArgsIsHelpError":
            raise


UsageError = typer.BadParameter.__mro__[1]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "models/README.md", *sorted(ROOT.glob("docs/*.md"))]
COMMANDS = [(path.name, *found) for path in DOCUMENTS for found in commands(path.read_text())]


def refused(document: str, words: str, complete: bool) -> str:
    """Return why a command cannot be typed, "" if it can."""
    try:
        parse(words, complete)
    except UsageError as error:
        return f"{document}: gellight{words}: {error}"
    return ""


def test_every_command_in_the_documents_can_be_typed() -> None:
    assert [why for command in COMMANDS if (why := refused(*command))] == []


def test_every_module_that_a_document_runs_is_there() -> None:
    places = [ROOT, ROOT / "models", ROOT / "host"]
    for document in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md"), *ROOT.glob("*/README.md")):
        for module in re.findall(r"python -m ((?:tests|gelnet|gellight)\.[\w.]*\w)", document.read_text()):
            path = module.replace(".", "/")
            files = [place / name for place in places for name in (f"{path}.py", f"{path}/__main__.py")]
            assert any(map(Path.is_file, files)), f"{document.name} runs {module}, which is not there"


def test_every_name_in_the_walks_is_there() -> None:
    walks = (ROOT / "CONTRIBUTING.md").read_text().partition("## Three walks")[2].partition("\n## ")[0]
    files = [*(ROOT / "host/gellight").rglob("*.py"), *(ROOT / "firmware/core").glob("*.c")]
    code = "\n".join(path.read_text() for path in files)
    names = {part for name in re.findall(r"`([A-Z]\w+(?:\.\w+)?|[a-z_]\w+)`", walks) for part in name.split(".")}
    assert len(names) > 40
    assert [name for name in names if not re.search(rf"^\s*(?:def|class|void|enum status) {name}\b", code, re.M)] == []


def test_no_command_stands_outside_a_block_or_behind_another_one() -> None:
    for path in {*DOCUMENTS, ROOT / "firmware/README.md"}:
        text = path.read_text()
        outside = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
        assert re.findall(r"^    gellight .*", outside, re.MULTILINE) == [], f"{path.name}: give it a block of its own"
        for words, _ in commands(text):
            assert " gellight " not in words.partition("#")[0], f"{path.name}: {words}"


def test_every_kind_of_command_is_found() -> None:
    text = "`gellight a`\n| `gellight b --c` |\n```\nsudo gellight d \\\n  e # f\n.venv/bin/gellight g\n```\n"
    assert [(words.split(), complete) for words, complete in commands(text)] == [
        (["d", "e", "#", "f"], True), (["g"], True), (["a"], False), (["b", "--c"], False),
    ]  # fmt: skip
    assert len(COMMANDS) > 60


@pytest.mark.parametrize(
    ("words", "complete"),
    [
        ("nonsense", False),
        ("calibrate nonsense", False),
        ("calibrate fit --nonsense 3", False),
        ("calibrate fit --epochs many", False),
        ("demo --frames", False),
        ("bench nonsense", False),
        ("calibrate fit --refine", True),
        ("optimize", True),
        ("demo 'sim://?a=1&b=2' | less", True),
    ],
)
def test_a_command_that_cannot_be_typed_is_noticed(words: str, complete: bool) -> None:
    with pytest.raises(UsageError):
        parse(words, complete)


def test_what_follows_a_command_is_left_out() -> None:
    parse("demo --sensor 'sim://?object=BALL&depth=1.0' --json | less  # a comment", True)


def test_every_option_in_the_text_exists() -> None:
    known = {"--system-site-packages"}
    for verb in verbs(get_command(app)):
        known.update(*(option.opts + option.secondary_opts for option in verb.params))
    for path in DOCUMENTS:
        named = set(re.findall(r"`(--[a-z][\w-]*)[^`]*`", path.read_text()))
        assert named <= known, path.name


def test_every_public_name_can_be_had_and_says_what_it_is() -> None:
    assert [name for name in gellight.__all__ if not getattr(gellight, name).__doc__] == []


def test_every_test_that_the_page_on_security_names_is_there() -> None:
    named = set(re.findall(r"`((?:\w+/)?test_\w+)`", (ROOT / "docs/security.md").read_text()))
    files = [path.with_suffix("").as_posix() for path in (ROOT / "tests").rglob("test_*.py")]
    assert len(named) > 8
    assert [name for name in named if not any(path.endswith(f"/{name}") for path in files)] == []


def test_the_notebook_is_kept_without_outputs() -> None:
    cells = json.loads((ROOT / "docs/first_touch.ipynb").read_text())["cells"]
    assert len({cell["id"] for cell in cells}) == len(cells)
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
