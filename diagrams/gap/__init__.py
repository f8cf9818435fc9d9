"""The sim-to-real gap in Drake: replay of logs, and the published real flights."""
