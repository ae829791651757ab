"""`gellight calibrate`: one file a verb."""
