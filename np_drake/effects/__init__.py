"""Physical effects that the nominal model leaves out, for simulation and for fitting; one pure object a file."""
