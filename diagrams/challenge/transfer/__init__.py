"""Transfer of the controller from the corrected simulator: what a diagnosis gains a controller made
in a simulator.
"""
