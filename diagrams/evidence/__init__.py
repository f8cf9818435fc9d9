"""The evidence: challenge sets, real flights, studies of the paper and of the docs."""
