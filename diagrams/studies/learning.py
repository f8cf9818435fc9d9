"""Training on simulated flights, up to the model file.

On one flight; or on flights over the envelope of a vehicle, from which a family of lifted linear
systems is learnt. Payload, tether, track, speed, dither, thrust and wind of each are drawn at
random. Sizes stand for the paper's vehicle and scale with another. Labels are made from what a
vehicle measures, as those of a real flight.
"""

import dataclasses as dc
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.batch.run import Case, Run, packed, unpacked
from diagrams.loop.controller_config import NP_MODEL, ControllerConfig
from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult, fly
from diagrams.loop.reality import RealityConfig
from diagrams.loop.scaled import scaled
from np_drake.labels import LabelConfig, default_labels
from np_drake.lifting.model.lifted_model import (
    FAMILIES,
    LIFTED,
    NEURAL,
    LiftedModel,
    load_model,
    origin_of,
    require_origin,
    save_model,
)
from np_drake.lifting.model.neural_family import NeuralFamily, with_network
from np_drake.lifting.training.network_training import PART
from np_drake.lifting.training.train import Config, TrainingResult, make_config
from np_drake.payload_filter.model_file import PAYLOAD_FILTER
from np_drake.payload_filter.training import train_payload_filter
from np_drake.references.config import ReferenceConfig
from np_drake.residual_models.motion_model import REACTIONS
from np_drake.residual_models.predictor_training import (
    place_on_flights,
    rotor_lag_in,
    train_motion_model,
    train_on_flights,
)
from np_drake.training_data.segments import Flight, Segment
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
# Of the simulator, or less where a short cable with a light payload is stiffer [s].
CABLE_STEP = 0.0015
TRACKS, HOW_OFTEN = ("circle", "lemniscate", "hover"), (0.6, 0.3, 0.1)
# The oracle keeps fast flights with heavy payloads on the track; holding the last wrench lets them
# swing.
CONTROLLERS, HOW_OFTEN_FLOWN = ("oracle", "hold", "nominal"), (0.6, 0.3, 0.1)
FLOWN = 24  # flights at most that judge a network, one for ten of the training [1]
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the network's own share, that are flown [1]


def train_model(
    flight: FlightResult, path: Path, *, configuration: str = NEURAL, seed: int = 0
) -> dict[str, Any]:
    """Train on the flight's log after the ramp, write the model file, and return its summary.

    `neural` places the packaged family, see `placed_family`, and `lifted` does so without its
    network; where there is none, `lifted` learns from the flight alone.
    Raises: ValueError: on an unknown configuration.
    """
    controller, vehicle, log = flight.config.controller, flight.config.vehicle, flight.log()
    log = log.rows(int(np.argmax(flight.scored)), len(log))
    step, label, flights = controller.period, controller.label, [Flight(log, vehicle)]
    if configuration in REACTIONS:
        how: dict[str, Any] = {"step": step, "label": label, "seed": seed}
        reaction, _ = train_motion_model(configuration, flights, **how)
        reaction.save(path)
        return reaction.summary
    if configuration == PAYLOAD_FILTER:
        payload_filter = train_payload_filter([(log, vehicle)], step=step)
        payload_filter.save(path)
        return payload_filter.summary
    model = None
    if configuration in FAMILIES:
        model, _ = placed_family(flights, step=step, label=label)
    if model is None:
        alone = LIFTED if configuration in FAMILIES else configuration
        config = make_config(alone, seed=seed)
        model = train_on_flights(flights, config, step=step, label=label).model
    elif configuration == LIFTED:
        model = model.without_network
    save_model(model, path)
    return model.summary


def placed_family(
    flights: Sequence[Flight], *, step: float, label: LabelConfig | None = None
) -> tuple[LiftedModel | None, str]:
    """Return the packaged family as the flights place it, and what to say of it.

    None where it is not of their vehicle, or foresees them no better than persistence.
    """
    prior = packaged_family(flights[0].vehicle, step=step, label=label)
    if prior is None or flights[0].frame != "world":
        return (
            None,
            (
                f"prior: none, as the packaged family is not of {flights[0].vehicle.name} at "
                f"this step."
            ),
        )
    try:
        model = place_on_flights(flights, prior, step=step, label=label)
    except ValueError as error:
        return None, f"{error} No prior is used."
    share = model.summary["placed"]["foresight"]
    if share >= 1.0:
        return (
            None,
            (
                f"prior: none, as the packaged family errs {share:.2g} times as much here as "
                f"persistence."
            ),
        )
    return (
        model,
        (
            f"prior: the packaged family, which errs at most {share:.2g} times as much here as "
            f"persistence."
        ),
    )


def packaged_family(
    vehicle: Vehicle, *, step: float, label: LabelConfig | None = None
) -> LiftedModel | None:
    """Return the packaged family of systems; None where it is of another vehicle, or of other
    labels.
    """
    prior = load_model(NP_MODEL)
    try:
        require_origin(prior, origin_of("world", vehicle, label or default_labels(vehicle)))
    except ValueError:
        return None
    return prior if abs(step / prior.step - 1) < 0.02 else None


def envelope_flight(number: int, *, seed: int, vehicle: Vehicle) -> FlightConfig:
    """Return one flight of the envelope.

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


def flown_segment(case: Case, *, seed: int, vehicle: Vehicle) -> dict:
    """Fly a flight of the envelope {"flight": number}, and return {"segment": its training segment
    as arrays in base 64}.
    """
    config = envelope_flight(case["flight"], seed=seed, vehicle=vehicle)
    log = fly(config, seed=case["flight"]).log()
    lagged = dc.replace(
        vehicle, rotor_time_constant=vehicle.rotor_time_constant or motor_lag(vehicle)
    )
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
    work = partial(flown_segment, seed=run.seed, vehicle=vehicle)
    cases = [{"flight": number} for number in range(count)]
    records = run.cases("envelope", "flights", work, cases, config=config)
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

    Raises: ValueError: where a flight is unusable.
    """
    envelope = envelope_segments(count, run=run, vehicle=vehicle)
    how: dict = {"step": step or sampling_period(vehicle), "label": None}
    with run.bar("training", 1.0) as advance:
        result = train_on_flights(
            flights,
            config,
            vehicle=vehicle,
            envelope=envelope,
            rotor_lag=rotor_lag_in(flights) or motor_lag(vehicle),
            on_epoch=lambda epoch, total, loss: advance(epoch / total, f"loss {loss:.4g}"),
            **how,
        )
    if not flights:
        return result
    return dc.replace(result, model=place_on_flights(flights, result.model, **how))


def flown_error(
    case: Case, *, models: Mapping[float, LiftedModel], seed: int, vehicle: Vehicle
) -> dict:
    """Fly a flight of the envelope with the model of a share of the network, a case {"flight",
    "share"}, and return {"error": position RMSE [m]}.
    """
    config = envelope_flight(case["flight"], seed=seed, vehicle=vehicle)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        save_model(models[case["share"]], path)
        config.controller.kind, config.controller.predictor = "np", str(path)
        return {"error": fly(config.check(), seed=case["flight"]).metrics()["position_rmse"]}


def flown_share(model: LiftedModel, first: int, *, run: Run, vehicle: Vehicle) -> LiftedModel:
    """Return the model with the share of its network that flies best, if it has a network."""
    family, count = model.encoder, min(FLOWN, first // PART)
    if not isinstance(family, NeuralFamily) or count == 0:
        return model
    choices = {}
    for share in SHARES:
        network = dc.replace(family.network, share=share * family.network.share)
        choices[share] = dc.replace(model, encoder=with_network(family, network))
    cases = [
        {"flight": first + number, "share": share} for number in range(count) for share in SHARES
    ]
    config = {
        "study": "network share",
        "seed": run.seed,
        "vehicle": dc.asdict(vehicle),
        "trained": model.summary,
    }
    work = partial(flown_error, models=choices, seed=run.seed, vehicle=vehicle)
    records = run.cases("network", "flights", work, cases, config=config)
    errors = [record["result"]["error"] if "result" in record else np.inf for record in records]
    if not np.any(np.isfinite(errors)):
        raise ValueError(
            f"network: none of {len(cases)} flights was flown to its end; the first: "
            f"{records[0]['error']}"
        )
    share = best_share(np.reshape(errors, (count, len(SHARES))))
    told = {**model.summary.get("network", {}), "flown_share": share, "flights_flown": count}
    return dc.replace(choices[share], summary={**model.summary, "network": told})


def best_share(errors: np.ndarray) -> float:
    """Return the share with the least mean logarithm of the error, among those that lose fewest
    vehicles.
    """
    lost = np.sum(~np.isfinite(errors), axis=0)
    kept = np.flatnonzero(lost == lost.min())
    flown = errors[np.all(np.isfinite(errors[:, kept]), axis=1)][:, kept]
    return SHARES[kept[np.argmin(np.log(flown).mean(axis=0))] if len(flown) else kept[0]]
