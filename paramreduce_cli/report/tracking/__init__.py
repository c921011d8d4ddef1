"""What a reduced model costs a controller, in simulation."""
