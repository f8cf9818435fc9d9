"""Forecast of the residual wrench on real flights with a payload, one manoeuvre left out."""
