"""Challenge flights in RotorPy, with effects implemented independently of the library."""
