"""Controllers of this project in a process of their own, beside a vehicle."""
