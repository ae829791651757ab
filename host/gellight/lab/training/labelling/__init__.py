"""Labels without clicks: where a ball touches the gel, found in the picture of a press alone."""
