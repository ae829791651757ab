"""`gellight config`: what is set, by whom, and what could be set."""

import json
from typing import Annotated

import tomli_w
import typer

from gellight.base.settings import Settings, file_paths, merge, read_layers, reference_markdown
from gellight.cli.options import AsJson
from gellight.cli.showing import show

app = typer.Typer(help="Show the settings, their schema, and the files they are read from.", no_args_is_help=True)


@app.command("show")
def show_settings(as_json: AsJson = False) -> None:
    """Print the settings in force and where each comes from."""
    layers = read_layers()
    settings = merge(layers).model_dump(exclude_none=True)
    origins = {
        f"{section}.{key}": layer.source for layer in layers for section, keys in layer.values.items() for key in keys
    }
    show({"settings": settings, "origins": origins}, as_json, as_toml(settings, origins))


@app.command()
def schema(markdown: Annotated[bool, typer.Option("--markdown", help="Print tables for people.")] = False) -> None:
    """Print the JSON schema of gellight.toml."""
    print(reference_markdown() if markdown else json.dumps(Settings.model_json_schema(), indent=2))


@app.command()
def path() -> None:
    """Print the files that are read, weakest first; a file that is not there is marked."""
    for file in file_paths():
        print(file if file.exists() else f"{file}  (not there)")


def as_toml(settings: dict[str, dict[str, object]], origins: dict[str, str]) -> str:
    """Return `settings` as TOML; a comment says where a value that is not a default comes from."""
    lines = []
    for section, values in ((name, keys) for name, keys in settings.items() if keys):
        lines.append(f"[{section}]")
        for key, value in values.items():
            origin = origins.get(f"{section}.{key}")
            lines.append(tomli_w.dumps({key: value}).strip() + (f"  # {origin}" if origin else ""))
        lines.append("")
    return "\n".join(lines).rstrip()
