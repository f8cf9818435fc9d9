"""The problems of the solvers' own tests, for their peers."""

import importlib.util
from pathlib import Path

_PROBLEMS = Path(__file__).parents[2] / "np_drake" / "mpc" / "conftest.py"
_spec = importlib.util.spec_from_file_location("mpc_problems", _PROBLEMS)
_problems = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_problems)
vehicle, config = _problems.vehicle, _problems.config
reaction, make_problem = _problems.reaction, _problems.make_problem
