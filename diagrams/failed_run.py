"""What a run raises that had good input and failed all the same."""


class FailedRun(RuntimeError):
    """One line for people: who failed, when, and why."""
