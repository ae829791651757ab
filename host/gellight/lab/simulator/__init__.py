"""The sensor that needs no hardware: a gel computed by `sim_reference`, lit by the core of the firmware."""
