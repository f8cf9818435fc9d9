"""What may be flown: flights drawn from ranges and from what is known of a vehicle, and an exact
bound of how often they fail.
"""

from diagrams.certify.certificate import Accepted, Bound, Certificate, certify
from diagrams.certify.ranges import Range, drawn_flight

__all__ = ["Accepted", "Bound", "Certificate", "Range", "certify", "drawn_flight"]
