"""Effects that the library does not have, by their physics."""
