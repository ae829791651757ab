"""What stands between a user and good frames, found by trying it: each finding with its remedy."""
