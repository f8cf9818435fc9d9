"""Closed-loop gap: what a diagnosis gains a controller that was made in a simulator."""
