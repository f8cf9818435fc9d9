"""Studies on real flights."""
