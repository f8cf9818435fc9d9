"""Demo: fly, learn, fly again, diagnose what the model lacks, correct the simulator, compare it
with the flights.
"""
