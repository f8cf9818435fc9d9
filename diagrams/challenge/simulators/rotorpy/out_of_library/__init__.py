"""Out-of-library effects, implemented independently for the simulator `rotorpy` from their equations alone."""
