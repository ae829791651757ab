"""The help shows a verb's options in groups."""

from collections import Counter
from typing import Any

import pytest
from typer.main import get_command

from gellight.cli.main import app
from gellight.cli.panels import MOST, PANELS
from tests.helpers.children import gellight
from tests.helpers.command_line import verbs

VERBS = list(verbs(get_command(app)))


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.name)
def test_the_first_group_of_every_verb_is_short(verb: Any) -> None:
    options = [one for one in verb.params if one.param_type_name == "option" and one.name != "help"]
    groups = Counter(one.rich_help_panel for one in options)
    assert groups[None] <= MOST, [one.opts for one in options if one.rich_help_panel is None]


def test_every_option_of_the_table_is_there() -> None:
    known = {option.lstrip("-") for verb in VERBS for one in verb.params for option in one.opts}
    named = {entry.rpartition("/")[2] for options in PANELS.values() for entry in options.split()}
    assert named <= known
    verbs_named = {entry.partition("/")[0] for options in PANELS.values() for entry in options.split() if "/" in entry}
    assert verbs_named <= {verb.name for verb in VERBS}


def test_the_help_prints_the_groups() -> None:
    said = gellight("calibrate", "--help", check=True).stdout
    first, _, rest = said.partition(" Files ")
    assert "--ball-radius-mm" in first
    assert "--resume" not in first
    assert "--resume" in rest
