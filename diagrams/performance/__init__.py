"""Run time of solvers, predictor, simulator and training."""
