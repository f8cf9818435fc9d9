"""The MPC problem (nmpc) of the paper and its solvers on MathematicalProgram."""
