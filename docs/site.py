"""Pages of the site that are no files in docs/: made of README, commands, settings and docstrings."""

import importlib
import inspect
import json
import posixpath
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from typer.main import get_command

import gellight
from gellight.base.settings import SECTIONS, Setting, reference
from gellight.cli.main import app

ROOT = Path(__file__).parent.parent
FROM_ROOT = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "firmware/README.md": "firmware.md",
    "models/README.md": "models.md",
}
"""files outside docs/, and what they are called in the site"""
LINK = re.compile(r"(\]\()(?!https?:|#)([^)#\s]+)")


def reference_markdown() -> str:
    """Return the reference as Markdown, one table a section; the site of the documentation shows it."""
    lines: list[str] = []
    for section, model in SECTIONS.items():
        lines += [f"### `[{section}]`", "", inspect.cleandoc(model.__doc__ or ""), ""]
        lines += ["| key | allowed | default | meaning |", "|---|---|---|---|"]
        lines += [_markdown_row(setting) for setting in reference() if setting.section == section]
        lines.append("")
    return "\n".join(lines)


def _markdown_row(setting: Setting) -> str:
    missing = "see above" if setting.section == "geometry" else "not given"
    default = missing if setting.default is None else f"`{json.dumps(setting.default)}`"  # as TOML has it
    return f"| `{setting.key}` | {setting.allowed} | {default} | {setting.description} |"


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add a page for each command to the navigation."""
    assert config.nav is not None
    config.nav.append({"Commands": [{name: f"verbs/{name}.md"} for name in commands()]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made."""
    made = {name: linked((ROOT / home).read_text(), home) for home, name in FROM_ROOT.items()}
    made |= {"settings.md": f"# Settings\n\n{reference_markdown()}", "api.md": api()}
    made["first_touch.md"] = notebook(ROOT / "docs/first_touch.ipynb")
    made |= {f"verbs/{name}.md": "\n\n".join(described(verb, name, "#")) for name, verb in commands().items()}
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links to files outside docs/ into links within the site."""
    home = page.file.src_uri
    return markdown if home in {*FROM_ROOT.values()} else linked(markdown, f"docs/{home}")


def linked(markdown: str, home: str) -> str:
    """Return the text of the file `home` with its links as they are in the site, where docs/ is the root."""

    def turned(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(home), match[2]))
        return match[1] + FROM_ROOT.get(target, target.removeprefix("docs/"))

    return LINK.sub(turned, markdown)


def notebook(path: Path) -> str:
    """Return a notebook as a page: its texts, and its code as blocks."""
    parts = []
    for cell in json.loads(path.read_text())["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    return "\n\n".join([*parts, f"[The notebook]({path.name}) itself, to run."])


def api() -> str:
    """Return the page of all public names, each from its docstring."""
    parts = ["# Python", inspect.cleandoc(gellight.__doc__ or "")]
    for name in gellight.__all__:
        if not name.startswith("_"):
            parts.append(f"::: {importlib.import_module(getattr(gellight, name).__module__).__name__}.{name}")
    return "\n\n".join(parts)


def commands() -> dict[str, Any]:
    """Return the verbs of the command line by name."""
    return dict(vars(get_command(app))["commands"])


def described(verb: Any, name: str, level: str) -> Iterator[str]:
    """Yield the Markdown of a command and of those below it, from their own help."""
    verb = verb.load() if hasattr(verb, "load") else verb
    yield f"{level} gellight {name}\n\n{inspect.cleandoc(verb.help or '')}"
    options = [one for one in verb.params if one.name != "help"]
    if options:
        yield "\n".join(["| option | takes | |", "|---|---|---|", *map(row, options)])
    for below, command in getattr(verb, "commands", {}).items():
        yield from described(command, f"{name} {below}", "##")


def row(option: Any) -> str:
    """Return one option as a row of a table."""
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    text = " ".join((getattr(option, "help", "") or "").split()).replace("|", "\\|")
    return f"| {names} | {takes(option)} | {text} |"


def takes(option: Any) -> str:
    """Return what an option is given: nothing, one of some words, or a kind of value."""
    kind = option.type_descriptor.annotation
    if getattr(option, "is_flag", False):
        return ""
    if isinstance(kind, type) and issubclass(kind, Enum):
        return ", ".join(str(one.value) for one in kind)
    return getattr(kind, "__name__", "")
