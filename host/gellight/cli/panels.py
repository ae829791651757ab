"""Groups of options in the help: what is rarely needed stands below what a verb is used with."""

from typing import Any

PANELS = {
    "Page": "port host tls-cert tls-key browser dashboard",
    "Other programs": "publish lan zenoh-config ros2 foxglove",
    "Light": "mode sequence light-mode",
    "Process": "realtime log threads dense workers shard scheduler store seed computed-by",
    "What is recorded": "depth map",
    "Other tools": "prism-angle-deg prism-presses prisms cylinder-diameter-mm balls-to-press",
    "Grids": "grid spacing-px pitch-mm pin-pitch-mm several",
    "Pictures": "view dots white overlay depth-scale-um",
    "Training": "recipe trainer width epochs folds previous like",
    "Limits": "largest-depth-error-um largest-normal-error-deg verifications until-um calibrate/presses",
    "Files": "surface/frame folder resume restart overwrite install",
    "Simulation": "gel resolution-mm friction path noise coarse/size design/size",
    "Shape of the part": "curved body",
    "Pins": "data-pin trigger-pin output-pin status-pin switch-pin",
}
"""by title: the options, or VERB/OPTION where one name means different things"""
MOST = 8
"""options that a verb shows above these groups"""
_TITLES = {option: title for title, options in PANELS.items() for option in options.split()}


def sort_options(command: Any) -> Any:
    """Give every option of a command, and of those below it, its group; return the command.

    A verb with few options keeps them together.
    """
    options = [one for one in command.params if one.param_type_name == "option" and one.name != "help"]
    if len(options) > MOST:
        for option in options:
            name = max(option.opts, key=len).lstrip("-")
            option.rich_help_panel = _TITLES.get(f"{command.name}/{name}", _TITLES.get(name))
    for below in getattr(command, "commands", {}).values():
        sort_options(below)
    return command
