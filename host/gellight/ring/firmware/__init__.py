"""The images of the light ring's board: what they say, and how they get there. `firmware/tools/` makes them."""
