"""Series of exposures, each under another light, in; depth out."""
