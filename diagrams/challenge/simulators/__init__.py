"""Simulators that fly challenge cases."""
