"""`gellight config show`: what is set, by whom, and what could be set."""

import json
from typing import Annotated

import tomli_w
import typer

from gellight.base.settings import Settings, file_paths, merge, read_layers
from gellight.cli.lazy import lazy_group
from gellight.cli.options import AsJson
from gellight.cli.showing import show

app = typer.Typer(
    cls=lazy_group({}, gone=dict.fromkeys(("schema", "path"), "is a part of `gellight config show` now")),
    help="Show the settings, and what could be set.",
    no_args_is_help=True,
)


@app.command("show")
def show_settings(
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of gellight.toml: all that can be set.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Print the settings in force, where each comes from, and the files that are read."""
    if schema:
        print(json.dumps(Settings.model_json_schema(), indent=2))
        return
    layers = read_layers()
    settings = merge(layers).model_dump(exclude_none=True)
    origins = {
        f"{section}.{key}": layer.source for layer in layers for section, keys in layer.values.items() for key in keys
    }
    files = {str(file): file.exists() for file in file_paths()}
    read = [f"# read: {file}{'' if there else '  (not there)'}" for file, there in files.items()]
    show(
        {"settings": settings, "origins": origins, "files": files},
        as_json,
        "\n".join([as_toml(settings, origins), "", *read]),
    )


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
