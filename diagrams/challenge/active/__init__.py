"""Loop of active diagnosis: fly, diagnose, design the next flight, fly it, until one explanation stands."""
