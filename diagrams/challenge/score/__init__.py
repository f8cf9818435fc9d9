"""Scores of answered challenge cases."""
