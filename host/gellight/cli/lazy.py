"""Verbs that are imported when they are used: the help of a group shows them all and imports none."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, get_args

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption
from typer.main import get_group

from gellight.base.errors import InputError

MARKUP: Literal["markdown"] = "markdown"
"""of the help; typer's other mode takes "[default: ...]" for markup and leaves it out"""
BESIDE = "Other distributions"
"""title of the verbs of others that name no panel"""
LARGEST = 1_000_000_000
"""largest number that an option takes, in any unit"""
_type_of_value = TyperOption.display_type_rich


def _shown_type(option: TyperOption, ctx: Any) -> str | None:
    """Return what help shows as an option's value: nothing for a flag, for `<bool>` would invite `--auto true`."""
    return None if option.is_flag else _type_of_value(option, ctx)


TyperOption.display_type_rich = _shown_type  # type: ignore[method-assign, assignment]


class LazyVerb(TyperCommand):
    """Stands in a group for a verb, or for a group of verbs, that is not imported yet."""

    def __init__(self, name: str, home: str, text: str, panel: str | None = None) -> None:
        """Remember what is imported: `home` is "module:attribute"; text: the first line of its help."""
        super().__init__(name, help=text, rich_markup_mode=MARKUP, rich_help_panel=panel)
        self.home = home

    def load(self) -> Any:
        """Import the function or the `typer.Typer` and return its command."""
        module, _, attribute = self.home.partition(":")
        verb = getattr(import_module(module), attribute)
        holder = typer.Typer(rich_markup_mode=MARKUP)
        if isinstance(verb, typer.Typer):
            holder.add_typer(verb, name=self.name)
        else:
            holder.command(self.name)(verb)
        return refuse_senseless(get_group(holder).commands[str(self.name)])

    def make_context(self, info_name: Any, args: Any, *more: Any, **options: Any) -> Any:
        """Parse the arguments of the verb: the first thing that a group does with the verb that was typed."""
        verb = self.load()
        _refuse_settings(verb, args)
        return verb.make_context(info_name, args, *more, **options)


def _refuse_settings(verb: Any, words: list[str]) -> None:
    """Raise InputError for what is no option of a verb but a setting; it says how that is set."""
    if words and (below := getattr(verb, "commands", {}).get(words[0])):
        verb = below
    known = {option for one in verb.params for option in (*one.opts, *one.secondary_opts)}
    unknown = {word.partition("=")[0] for word in words if word.startswith("--") and not isinstance(verb, LazyVerb)}
    for option in unknown - known:
        from gellight.base.settings import SECTIONS  # a third of the time of `--help`

        key = option.removeprefix("--").replace("-", "_")
        names = [f"{section}.{key}" for section, model in SECTIONS.items() if key in model.model_fields]
        how = f"give --set {' or '.join(names)}=VALUE" if "--set" in known else "write it into gellight.toml"
        if names:
            raise InputError(f"{option} is the setting {' or '.join(names)}: {how}")


def refuse_senseless(command: Any) -> Any:
    """Have a command, and those below it, refuse what no option or argument can mean; return the command.

    `Path("")` is the current folder, and what was read from an unset variable of the shell would be written there. An
    empty text is refused likewise, unless it is the default. NaN passes every limit that is written as x < least, and
    numbers far beyond those of a sensor overflow somewhere in the work.
    """
    for one in command.params:
        one.process_value = partial(_process, one, one.process_value)
    for below in getattr(command, "commands", {}).values():
        refuse_senseless(below)
    return command


def _kinds(annotation: Any) -> Iterator[Any]:
    """Yield a type and those it is made of: `str` too of `list[str] | None`."""
    yield annotation
    for part in get_args(annotation):
        yield from _kinds(part)


def _process(option: Any, process: Callable[[Any, Any], Any], context: Any, typed: Any) -> Any:
    for one in typed if isinstance(typed, list | tuple) else [typed]:
        _check(option, one)
    try:
        return process(context, typed)
    except typer.BadParameter as error:
        _reword(error)
        raise


def _check(option: Any, typed: Any) -> None:
    kinds = set(_kinds(option.type_descriptor.annotation))
    name = option.opts[-1] if option.opts[-1].startswith("-") else option.opts[-1].upper()
    if Path in kinds:
        if typed == "":
            raise InputError(f"{name} '' names no file and no folder: give a path, or . for this folder")
    elif str in kinds:
        if typed == "" and option.default != "":
            raise InputError(f"{name} '' is empty: give it a value, or leave it out")
    elif kinds & {int, float}:
        with suppress(TypeError, ValueError):  # what is no number is told by typer
            if not abs(float(typed)) <= LARGEST:
                raise InputError(f"{name} {typed} is not possible: give a number from {-LARGEST} to {LARGEST}")


def _reword(error: typer.BadParameter) -> None:
    """Say in a user's words what pydantic says of a value that typer has it check."""
    from pydantic import ValidationError  # a third of the time of `--help`

    from gellight.base.allowed import in_words

    if isinstance(refused := error.__cause__, ValidationError):
        (first, *_) = refused.errors(include_url=False)
        said = first["ctx"]["error"] if first["type"] == "value_error" else in_words(refused, "").removeprefix(" = ")
        error.message = str(said)


def lazy_group(
    table: Mapping[str, tuple[str, str]], gone: Mapping[str, str] = MappingProxyType({})
) -> type[TyperGroup]:
    """Return a group for `typer.Typer(cls=...)`; table: by name, a place in `gellight.cli` and what the help says.

    gone: by name, what to give instead of a verb that is no more.
    """
    return _group({name: (f"gellight.cli.{home}", text) for name, (home, text) in table.items()}, gone)


def open_group(panels: Mapping[str, Mapping[str, tuple[str, str]]], gone: Mapping[str, str]) -> type[TyperGroup]:
    """Return such a group, in panels of the help, with the verbs of installed distributions too.

    These are found by the entry points `gellight.verbs`, which name a table each: by name, a place with the whole name
    of its module, what the help says, and, if wanted, the panel.
    """
    verbs = {
        name: (f"gellight.cli.{home}", text, title)
        for title, table in panels.items()
        for name, (home, text) in table.items()
    }
    for found in entry_points(group="gellight.verbs"):
        verbs |= {name: (home, text, *(panel or [BESIDE])) for name, (home, text, *panel) in found.load().items()}
    return _group(verbs, gone)


def _group(table: Mapping[str, tuple[str, ...]], gone: Mapping[str, str]) -> type[TyperGroup]:
    class Group(TyperGroup):
        def __init__(self, **attributes: Any) -> None:
            super().__init__(**attributes)
            for name, known in table.items():
                self.add_command(LazyVerb(name, *known))

        def get_command(self, ctx: Any, cmd_name: str) -> Any:
            """Return a verb; InputError, with the remedy, for one that is not here."""
            if cmd_name in gone and cmd_name not in self.commands:
                raise InputError(f"the verb `{cmd_name}` {gone[cmd_name]}")
            return super().get_command(ctx, cmd_name)

    return Group
