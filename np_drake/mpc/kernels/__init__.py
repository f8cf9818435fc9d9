"""Compiled loops of the MPC: plain functions over arrays that the caller owns."""
