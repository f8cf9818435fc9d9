"""Examination of flight logs before a diagnosis: usable or not, and which effects they can tell, to what size."""

from np_drake.diagnosis.doctor.examine import examine
from np_drake.diagnosis.doctor.log_report import Answer, FlightFacts, Lag, LogReport, SwingTest

__all__ = ["Answer", "FlightFacts", "Lag", "LogReport", "SwingTest", "examine"]
