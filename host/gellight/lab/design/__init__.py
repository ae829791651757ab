"""The illumination optimiser of `sim_reference`, run at scale, drawn, and turned into parts."""
