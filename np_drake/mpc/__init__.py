"""The paper's problem (nmpc) and its solvers on MathematicalProgram."""
