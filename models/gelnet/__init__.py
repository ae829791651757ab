"""GelNet: the network that maps a pixel's colour and place to the slope of the gel there."""
