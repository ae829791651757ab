"""From labelled presses to a network."""
