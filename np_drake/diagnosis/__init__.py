"""Diagnosis of the sim-to-real gap from flight logs: `diagnose.diagnose`, its `options` and its
`result`.
"""
