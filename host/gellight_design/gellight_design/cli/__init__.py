"""The verbs that this distribution adds to `gellight`; their work is imported when they run."""

VERBS = {
    "optimize": ("gellight_design.cli.optimize:app", "Find the best illumination and make its parts.", "Develop"),
    "simulate": ("gellight_design.cli.simulate:app", "Press objects into the simulated gel, as files.", "Develop"),
}
