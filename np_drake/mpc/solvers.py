"""Solvers by name."""

from np_drake.mpc.problem import MpcConfig, MpcSolver
from np_drake.vehicle import Vehicle

SOLVERS = ("ipopt", "sqp")  # names for `make_solver`


def require_solver(name: str) -> None:
    """Check that a solver of that name exists.

    Raises: ValueError: on an unknown name.
    """
    if name not in SOLVERS:
        raise ValueError(f"solver: must be one of {', '.join(SOLVERS)}; got {name!r}.")


def make_solver(
    name: str, vehicle: Vehicle, config: MpcConfig, *, time_limit: float = float("inf")
) -> MpcSolver:
    """Return the solver called `name`.

    Args:
        time_limit: wall time after which iterations stop [s]; without one, results repeat on any
            machine.
    Raises: ValueError: on an unknown name.
    """
    require_solver(name)
    if name == "sqp":
        from np_drake.mpc.sqp import SqpSolver

        return SqpSolver(vehicle, config, time_limit=time_limit)
    from np_drake.mpc.ipopt import IpoptCondensedSolver

    return IpoptCondensedSolver(vehicle, config, time_limit=time_limit)
