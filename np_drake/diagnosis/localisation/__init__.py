"""Where the gap lies, and which effects the logs cannot tell apart."""
