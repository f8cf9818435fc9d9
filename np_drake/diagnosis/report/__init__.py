"""Report of a diagnosis: one HTML page, its figures and its JSON."""
