"""The firmware of the light ring, from its sources to the board: generate, build, pack, flash."""
