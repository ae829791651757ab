"""The verbs that this distribution adds to `gellight`; their work is imported when they run."""

VERBS = {"optimize": ("gellight_design.cli.optimize:app", "Find the best illumination and make its parts.", "Develop")}
