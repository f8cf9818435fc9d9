"""What the network of `neural` adds on flights of the envelope that nothing was trained on."""

import dataclasses as dc
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Option

from diagrams.batch.arrays import unpacked
from diagrams.batch.campaign import Case
from diagrams.batch.run import Report, Run
from diagrams.loop.controller_config import NP_MODEL
from diagrams.prediction.envelope import Envelope, envelope_flight
from np_drake.lifting.model.lifted_model import FAMILIES, LIFTED, NEURAL, LiftedModel
from np_drake.lifting.model.model_file import load_model
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.vehicle import Vehicle

HORIZONS = (5, 10, 20, 40)  # up to that of the controller [steps]
PERSISTENCE = "persistence"
SLOW, FAST, LIGHT, HEAVY = 1.2, 1.8, 0.15, 0.3  # bounds of the groups [m/s, m/s, kg, kg]


@dc.dataclass(frozen=True)
class Foreseeing:
    """Work of a case {"flight"} -> {"speed", "mass", "rmse": row -> force at `HORIZONS`, motion
    known [m/s, kg, N]}.
    """

    envelope: Envelope
    models: dict[str, LiftedModel]

    def __call__(self, case: Case) -> dict:
        """Fly it and foresee its force from every sample.

        Raises: ValueError: if it is too short.
        """
        config = envelope_flight(
            case["flight"], seed=self.envelope.seed, vehicle=self.envelope.vehicle
        )
        arrays = unpacked(self.envelope(case)["segment"])
        chi, zeta, goal = arrays["chi"], arrays["zeta"], arrays["goal"][:, :3]
        first = max(model.warm_up for model in self.models.values()) - 1
        if len(chi) <= first + HORIZONS[-1]:
            raise ValueError(
                f"flight {case['flight']}: at least {first + 1 + HORIZONS[-1]} samples are needed."
            )
        origins = np.arange(first, len(chi) - HORIZONS[-1])
        wanted = goal[origins[:, None] + HORIZONS]
        rmse = {PERSISTENCE: _rmse(chi[origins, None, :3] - wanted)}
        for name, model in self.models.items():
            course = NeuralPredictor(model).along(chi, zeta)
            assert course is not None
            rmse[name] = _rmse(
                course.at(list(HORIZONS), origins, zeta, zeta_known=True)[..., :3] - wanted
            )
        hung = config.reality.payload
        speed = 0.0 if config.reference.track == "hover" else config.reference.speed
        return {"speed": speed, "mass": 0.0 if hung.tether == "none" else hung.mass, "rmse": rmse}


def _rmse(error: np.ndarray) -> list[float]:
    """Return the root mean square over origins of the length of errors (o, h, 3), at each
    horizon.
    """
    return np.sqrt(np.mean(np.sum(error**2, axis=2), axis=0)).tolist()


def ratios(flights: list[dict]) -> list[dict]:
    """Return one line a group, row and horizon: median and 90 % quantile over flights of the RMSE
    over another row's.

    The families are over persistence, and `neural` also over `lifted`.

    Args:
        flights: results of `Foreseeing`.
    """
    names = [name for name in flights[0]["rmse"] if name != PERSISTENCE]
    pairs = [(name, PERSISTENCE) for name in names] + (
        [(NEURAL, LIFTED)] if NEURAL in names else []
    )
    lines = []
    for group, members in groups(flights).items():
        for row, over in pairs:
            found = np.array([np.divide(f["rmse"][row], f["rmse"][over]) for f in members])
            lines += [
                {"group": group, "flights": len(members), "row": row, "over": over, "steps": h}
                | {"median": float(np.median(of)), "quantile": float(np.quantile(of, 0.9))}
                for h, of in zip(HORIZONS, found.T, strict=True)
            ]
    return lines


def groups(flights: list[dict]) -> dict[str, list[dict]]:
    """Return the flights of each group that has some, by name."""
    kinds = {
        "all": lambda f: True,
        f"below {SLOW} m/s": lambda f: f["speed"] < SLOW,
        f"above {FAST} m/s": lambda f: f["speed"] > FAST,
        "no payload": lambda f: f["mass"] == 0,
        f"below {LIGHT} kg": lambda f: 0 < f["mass"] < LIGHT,
        f"above {HEAVY} kg": lambda f: f["mass"] > HEAVY,
    }
    found = {name: [flight for flight in flights if kind(flight)] for name, kind in kinds.items()}
    return {name: members for name, members in found.items() if members}


@dc.dataclass(frozen=True)
class Options:
    """Options of the study."""

    flights: Annotated[int, Option(min=1, max=10_000, help="Fresh flights of the envelope.")] = 100
    predictor: Annotated[
        Path | None,
        Option(
            "--predictor",
            metavar="FILE",
            help="Family of the paper's vehicle; default: the packaged one.",
        ),
    ] = None


def run(run: Run, options: Options) -> Report:
    """What the network adds on fresh flights of the envelope, over the same family without it."""
    model = load_model(options.predictor or NP_MODEL)
    if model.configuration not in FAMILIES:
        raise ValueError(
            f"--predictor: must be of {' | '.join(FAMILIES)}; got {model.configuration}."
        )
    models = {m.configuration: m for m in (model.without_network, model)}
    work = Foreseeing(Envelope(run.seed, Vehicle()), models)
    config = {
        "study": "network",
        "seed": run.seed,
        "trained": {name: m.summary for name, m in models.items()},
    }
    records = run.cases(
        "envelope", "flights", work, [{"flight": n} for n in range(options.flights)], config=config
    )
    flights = [record["result"] for record in records if "result" in record]
    if not flights:
        raise ValueError(
            "envelope: none of the flights was flown to its end; ask for more --flights."
        )
    lines = ratios(flights)
    header = ["flights", "number", "row", "over", *(f"{h * model.step:.3g} s" for h in HORIZONS)]
    rows: list[tuple] = []
    for at in range(0, len(lines), len(HORIZONS)):
        of = lines[at : at + len(HORIZONS)]
        cells = (f"{line['median']:.2f} ({line['quantile']:.2f})" for line in of)
        rows.append((of[0]["group"], of[0]["flights"], of[0]["row"], of[0]["over"], *cells))
    title = (
        "RMSE of the force over that of another row, motion known: median over flights (90 "
        "% quantile)"
    )
    return Report(
        [(title, header, rows)],
        config={"flights": options.flights, "seed": run.seed},
        metrics={"ratios": lines},
        lines=[f"seed {run.seed}; {len(flights)} of {options.flights} flights"],
    )
