"""Tests of whether a model explains the residual, and what is left unexplained."""
