"""Challenge flights in Drake."""
