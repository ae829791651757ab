"""The verbs that this distribution adds to `gellight`; their work is imported when they run."""

VERBS = {
    "scan": (
        "gellight_scan.cli.scan_verb:command",
        "Scan a surface that is larger than the view: press, lift, press beside, over half of a press that was.",
    ),
    "surface": (
        "gellight_scan.cli.surface_verb:command",
        "Measure the roughness of a surface, or write it for other programs.",
    ),
}
