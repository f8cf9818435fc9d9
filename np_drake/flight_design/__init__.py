"""Design of the next flight: the motion that best separates the explanations that still stand."""
