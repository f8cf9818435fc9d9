"""One closed-loop flight: diagram, controllers, scenarios, result."""
