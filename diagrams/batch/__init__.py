"""Many runs: worker processes, clusters, resumable campaigns."""
