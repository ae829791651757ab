"""How a sensor sees: its lens, and the light of each LED, measured."""
