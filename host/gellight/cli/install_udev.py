"""`gellight install-udev`: let users who are not root use the sensor."""

from typing import Annotated

import typer

from gellight.sensor import udev


def command(show: Annotated[bool, typer.Option("--print", help="Only print the rule.")] = False) -> None:
    """Let users who are not root use the sensor; needs root.

    It installs a udev rule.
    """
    if show:
        print(udev.RULE.read_text(), end="")
        return
    print(f"{udev.install()} is installed: unplug the sensor and plug it in")
