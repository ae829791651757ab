"""Everything that speaks to the board of the light ring."""
