"""The report of a diagnosis: one page that a person reads from top to bottom, its figures and its JSON."""
