"""Experiments as Gymnasium environments; an import registers `np_drake/Track-v0` where gymnasium is installed."""

from diagrams.gym.registration import installed, make_env, register

__all__ = ["make_env", "register"]

if installed():
    register()
