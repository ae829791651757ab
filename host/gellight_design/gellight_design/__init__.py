"""The illumination optimiser of `sim_reference`, run at scale; boards to order and a housing to print."""
