"""A lens measured with a grid of pins of known pitch."""
