"""Simulated flights over the envelope of a vehicle, from which a family of lifted linear systems is
learnt.

Payload, tether, track, speed, dither, thrust and wind of each flight are drawn at random. Sizes
stand for the paper's vehicle and scale with another. Labels are made from what a vehicle measures,
as those of a real flight.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from diagrams.batch.arrays import packed, unpacked
from diagrams.batch.campaign import Case
from diagrams.batch.run import Run
from diagrams.loop.controller_config import ControllerConfig
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import fly
from diagrams.loop.reality import RealityConfig
from diagrams.loop.scaled import scaled
from np_drake.lifting.training.train import Config, TrainingResult
from np_drake.references.config import ReferenceConfig
from np_drake.residual_models.predictor_training import (
    place_on_flights,
    rotor_lag_in,
    train_on_flights,
)
from np_drake.training_data.segments import Segment
from np_drake.training_data.training_segments import Flight
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import ratios, sampling_period
from systems.payload_config import PayloadConfig

DURATION = 14.0  # of a flight after its ramp [s]
MASS = (0.03, 0.5)  # of the payload, up to a third of the paper's vehicle [kg]
BARE = 0.1  # share of flights without payload [1]
LENGTH = (0.37, 1.75)  # of the tether, evenly in its logarithm [m]
SPEED = (0.4, 2.75)  # along the track [m/s]
RADIUS = (0.8, 1.6)  # of a circle [m]
RAMP = (2.5, 5.0)  # to the track's speed [s]
DITHER = (0.0, 0.04, 0.08)  # RMS of the dither in x and y, half of it in z [m]
THRUST = (0.92, 1.02)  # real over nominal thrust [1]
WIND = 4.0  # standard deviation of the wind in x and y, in one flight of three [m/s]
GUST = 0.4  # largest standard deviation of its gusts [m/s]
HEIGHT = 2.5  # of the track, room for the longest tether [m]
CABLE_STEP = (
    0.0015  # of the simulator, or less where a short cable with a light payload is stiffer [s]
)
TRACKS, HOW_OFTEN = ("circle", "lemniscate", "hover"), (0.6, 0.3, 0.1)
# The oracle keeps fast flights with heavy payloads on the track; holding the last wrench lets them
# swing.
CONTROLLERS, HOW_OFTEN_FLOWN = ("oracle", "hold", "nominal"), (0.6, 0.3, 0.1)


def envelope_flight(number: int, *, seed: int, vehicle: Vehicle) -> FlightConfig:
    """Return one flight of the envelope.

    Args:
        number: of the flight, from 0 on.
    Raises: ValueError: where this vehicle cannot fly what was drawn.
    """
    rng = np.random.default_rng([seed, number])
    track = str(rng.choice(TRACKS, p=HOW_OFTEN))
    dither = 0.08 if track == "hover" else float(rng.choice(DITHER))
    reference = ReferenceConfig(track=track, height=HEIGHT, dither=[dither, dither, dither / 2])
    speed, radius, ramp = (float(rng.uniform(*span)) for span in (SPEED, RADIUS, RAMP))
    if track != "hover":
        reference = dc.replace(reference, speed=speed, ramp=ramp)
    if track == "circle":
        reference = dc.replace(reference, radius=radius)
    payload = PayloadConfig(
        mass=float(rng.uniform(*MASS)), length=float(np.exp(rng.uniform(*np.log(LENGTH))))
    )
    payload = PayloadConfig(tether="none") if rng.random() < BARE else payload
    reality = RealityConfig(payload=payload, thrust_scale=float(rng.uniform(*THRUST)))
    if rng.random() < 1 / 3:
        reality.wind = [*(WIND * rng.standard_normal(2)).tolist(), 0.0]
        reality.gust, reality.gust_seed = float(rng.uniform(0, GUST)), number
    controller = ControllerConfig(
        kind=str(rng.choice(CONTROLLERS, p=HOW_OFTEN_FLOWN)), solver="sqp"
    )
    config = FlightConfig("envelope", DURATION, True, vehicle, reality, reference, controller)
    config.simulator.max_step_size = CABLE_STEP
    config = scaled(config)
    config.simulator.max_step_size = min(config.simulator.max_step_size, config.largest_step)
    return config.check()


@dc.dataclass(frozen=True)
class Envelope:
    """Work of a flight of the envelope: {"flight": number} -> {"segments": arrays in base 64}."""

    seed: int
    vehicle: Vehicle

    def __call__(self, case: Case) -> dict:
        """Fly it and return its training segments."""
        config = envelope_flight(case["flight"], seed=self.seed, vehicle=self.vehicle)
        log = fly(config, seed=case["flight"]).log()
        lag = self.vehicle.rotor_time_constant or motor_lag(self.vehicle)
        lagged = dc.replace(self.vehicle, rotor_time_constant=lag)
        pieces = Flight(log, lagged).segments(config.controller.period, config.controller.label)
        piece = max(pieces, key=len)
        return {"segment": packed({"chi": piece.chi, "zeta": piece.zeta, "goal": piece.goal})}


def motor_lag(vehicle: Vehicle) -> float:
    """Return the time constant of the rotors in flights of the envelope [s]."""
    return RealityConfig().motor_lag * ratios(vehicle).time


def envelope_segments(count: int, *, run: Run, vehicle: Vehicle) -> list[Segment]:
    """Fly `count` flights of the envelope and return what can be learnt from; a lost vehicle
    teaches nothing.
    """
    step = sampling_period(vehicle)
    config = {"study": "envelope", "vehicle": dc.asdict(vehicle), "seed": run.seed}
    work = Envelope(run.seed, vehicle)
    cases = [{"flight": number} for number in range(count)]
    records = run.cases("envelope", "flights", work, cases, config=config, part="envelope")
    found = []
    for record in records:
        if "result" in record:
            arrays = unpacked(record["result"]["segment"])
            found.append(Segment(arrays["chi"], arrays["zeta"], step, arrays["goal"]))
    return found


def train_on_envelope(
    count: int,
    config: Config,
    *,
    run: Run,
    vehicle: Vehicle,
    flights: Sequence[Flight] = (),
    step: float | None = None,
) -> TrainingResult:
    """Fly the envelope and train on it and on further flights; where there are some, theta starts
    where they leave it.

    Args:
        step: time between samples, None for that of the vehicle [s].
    Raises: ValueError: where a flight is unusable.
    """
    envelope = envelope_segments(count, run=run, vehicle=vehicle)
    how: dict = {"step": step or sampling_period(vehicle), "label": None}
    with run.progress("training") as advance:
        result = train_on_flights(
            flights,
            config,
            vehicle=vehicle,
            envelope=envelope,
            rotor_lag=rotor_lag_in(flights) or motor_lag(vehicle),
            on_epoch=lambda epoch, total, loss: advance(epoch / total, f"loss {loss:.4g}"),
            **how,
        )
    return (
        dc.replace(result, model=place_on_flights(flights, result.model, **how))
        if flights
        else result
    )
