"""Solvers by name."""

from np_drake.mpc.problem import MpcConfig, MpcSolver
from np_drake.vehicle import Vehicle

SOLVERS = ("ipopt", "sqp", "ipopt_multiple_shooting")


def make_solver(name: str, vehicle: Vehicle, config: MpcConfig) -> MpcSolver:
    """The solver called `name`. Raises ValueError on an unknown name."""
    if name == "sqp":
        from np_drake.mpc.sqp import SqpSolver

        return SqpSolver(vehicle, config)
    if name == "ipopt":
        from np_drake.mpc.ipopt import IpoptCondensedSolver

        return IpoptCondensedSolver(vehicle, config)
    if name == "ipopt_multiple_shooting":
        from np_drake.mpc.ipopt_multiple_shooting import IpoptMultipleShootingSolver

        return IpoptMultipleShootingSolver(vehicle, config)
    raise ValueError(f"make_solver: must be one of {', '.join(SOLVERS)}; got {name!r}.")
