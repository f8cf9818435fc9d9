"""Diagnosis of real flights whose cause is known: cases, truth, opponents and score."""
