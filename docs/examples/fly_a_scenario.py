"""Flies one scenario with two controllers and compares their tracking errors.

Shows: a scenario file that names only what differs from the defaults, `load_flight`, `fly`, and the
metrics and the flight log of the result.
"""

import dataclasses as dc
from pathlib import Path

from diagrams.loop.flight import load_flight
from diagrams.loop.flight_result import fly
from np_drake.logs.formats.log_file import write_log

SCENARIO = """\
name: heavy_circle
duration: 6.0                                            # scored, after the ramp [s]
reference: {track: circle, radius: 1.2, speed: 1.5, ramp: 3.0}
reality: {payload: {mass: 0.4, length: 1.0}, wind: [1.0, 0.0, 0.0]}
controller: {kind: payload_filter, solver: sqp}
"""


def main() -> None:
    """Writes the scenario, flies it with nominal MPC and payload_filter, prints E_xy and E_z."""
    file = Path("heavy_circle.yaml")
    file.write_text(SCENARIO)
    config = load_flight(str(file))
    for kind in ("nominal", "payload_filter"):
        flown = dc.replace(config, controller=dc.replace(config.controller, kind=kind))
        result = fly(flown, seed=1)
        errors = result.metrics()
        print(f"{kind:14} E_xy {100 * errors['E_xy']:5.2f} cm   E_z {100 * errors['E_z']:5.2f} cm")
        write_log(result.log(), f"heavy_circle_{kind}.csv")


if __name__ == "__main__":
    main()
