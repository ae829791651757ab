"""The verbs that this distribution adds to `gellight`; their work is imported when they run."""

VERBS = {
    "scan": (
        "gellight_scan.cli.scan_verb:command",
        "Scan a surface larger than the view, press by press.",
        "Run",
    ),
    "surface": ("gellight_scan.cli.surface_verb:command", "Measure the roughness of a surface, or export it.", "Run"),
}
