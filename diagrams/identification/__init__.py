"""Identification checked on simulated vehicles whose parameters are known, and on real flights."""
