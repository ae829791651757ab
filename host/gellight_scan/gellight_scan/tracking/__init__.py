"""Where the object in the gel has gone: rigid motion between frames, with its covariance."""
