"""Rules of form for the help of all verbs."""

from collections import Counter

import pytest
from rich.text import Text
from typer.main import get_command

from gellight.cli.lazy import LazyVerb
from gellight.cli.main import app
from tests.helpers.command_line import verbs

pytestmark = pytest.mark.style
VERBS = list(verbs(get_command(app)))


def test_a_group_shows_of_a_verb_the_first_paragraph_of_its_help() -> None:
    lazy = [one for group in VERBS for one in getattr(group, "commands", {}).values() if isinstance(one, LazyVerb)]
    assert len(lazy) > 20
    assert [one.home for one in lazy if " ".join(one.load().help.split("\n\n")[0].split()) != one.help] == []


def test_the_help_of_every_option_is_shown_as_it_is_written() -> None:
    """Square brackets would be taken for markup and vanish, and a default that is told in them too."""
    texts = [each.help for verb in VERBS for each in (verb, *verb.params)]
    assert len(texts) > 100
    assert [text for text in texts if text and Text.from_markup(text).plain != text] == []


def test_the_first_group_of_every_verb_is_short() -> None:
    groups = {
        verb.name: Counter(
            one.rich_help_panel for one in verb.params if one.param_type_name == "option" and one.name != "help"
        )
        for verb in VERBS
    }
    assert {name: panels[None] for name, panels in groups.items() if panels[None] > 6} == {}
