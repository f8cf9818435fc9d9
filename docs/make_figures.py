"""Draws docs/figures/report_timeline.png (`python docs/make_figures.py`)."""

import dataclasses as dc
from pathlib import Path

from matplotlib.figure import Figure

from diagrams.loop.flight import default_flight
from diagrams.loop.flight_result import fly
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.report.figures import timeline_figure
from np_drake.files.figure_file import png
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig

FILE = Path(__file__).parent / "figures" / "report_timeline.png"
RESOLUTION = 70  # [dots an inch]


def timeline() -> Figure:
    """Return the residual against time in the report on the drag of
    docs/guide/read-the-report.md.
    """
    config = default_flight(Vehicle())
    config.reality.payload, config.reality.rotor_drag = PayloadConfig(tether="none"), 0.4
    config.reality.motor_lag, config.reality.thrust_scale = 0.0, 1.0
    config.duration, config.reference.speed, config.reference.ramp = 5.0, 2.0, 2.0
    config.reference.dither = [0.08, 0.08, 0.04]
    logs = []
    for seed in range(2):
        config.reference.dither_seed = seed
        logs.append(fly(config.check_and_step(), seed=seed).log())
    names = ("train_1.csv", "heldout_1.csv")
    train, held_out = (dc.replace(log, name=name) for log, name in zip(logs, names, strict=True))
    return timeline_figure(diagnose(config.vehicle, [train], [held_out]).localisation, {})


if __name__ == "__main__":
    FILE.write_bytes(png(timeline(), RESOLUTION))
