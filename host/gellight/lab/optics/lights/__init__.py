"""The light of each LED of a real ring, measured."""
