"""Share of a network's correction that flies best, on simulated flights over the envelope.

A network that foresees flights better, the coming motion known, does not always fly better. So it
is flown.
"""

import dataclasses as dc
import tempfile
from pathlib import Path

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.batch.run import Run
from diagrams.loop.flight_result import fly
from diagrams.prediction.envelope import envelope_flight
from diagrams.tracking.model_files import digest_of, model_path
from np_drake.lifting.model.lifted_model import LiftedModel
from np_drake.lifting.model.model_file import save_model
from np_drake.lifting.model.neural_family import NeuralFamily, with_network
from np_drake.lifting.training.network_training import PART
from np_drake.vehicle import Vehicle

FLOWN = 24  # flights at most, one for ten of the training [1]
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the network's own share, that are flown [1]


@dc.dataclass(frozen=True)
class Flying:
    """Work of a case {"flight", "share"} -> {"error": position RMSE [m]}.

    models: content of the model file of each share.
    """

    models: dict[float, bytes]
    seed: int
    vehicle: Vehicle

    def __call__(self, case: Case) -> dict:
        """Fly a flight of the envelope with the model."""
        config = envelope_flight(case["flight"], seed=self.seed, vehicle=self.vehicle)
        with model_path(self.models[case["share"]]) as path:
            config.controller.kind, config.controller.predictor = "np", path
            return {"error": fly(config.check(), seed=case["flight"]).metrics()["position_rmse"]}


def flown_share(model: LiftedModel, first: int, *, run: Run, vehicle: Vehicle) -> LiftedModel:
    """Return the model with the share of its network that flies best; one without network as it is.

    Args:
        first: number of the first flight; as many, those before it, are of the training.
    """
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
    contents = {share: _content(choice) for share, choice in choices.items()}
    trained = digest_of(contents[SHARES[-1]])
    config = {
        "study": "network share",
        "seed": run.seed,
        "vehicle": dc.asdict(vehicle),
        "trained": trained,
    }
    work = Flying(contents, run.seed, vehicle)
    records = run.cases("network", "flights", work, cases, config=config, part="network")
    errors = [record["result"]["error"] if "result" in record else np.inf for record in records]
    if not np.any(np.isfinite(errors)):
        raise ValueError(
            f"network: none of {len(cases)} flights was flown to its end; the first: "
            f"{records[0]['error']}"
        )
    share = best_share(np.reshape(errors, (count, len(SHARES))))
    told = {**model.summary.get("network", {}), "flown_share": share, "flights_flown": count}
    return dc.replace(choices[share], summary={**model.summary, "network": told})


def _content(model: LiftedModel) -> bytes:
    """Return the content of the model's file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        save_model(model, path)
        return path.read_bytes()


def best_share(errors: np.ndarray) -> float:
    """Return the share with the least mean logarithm of the error, among those that lose fewest
    vehicles.

    Args:
        errors: (flights, shares) of `SHARES` [m]; infinite where the vehicle was lost.
    """
    lost = np.sum(~np.isfinite(errors), axis=0)
    kept = np.flatnonzero(lost == lost.min())
    flown = errors[np.all(np.isfinite(errors[:, kept]), axis=1)][:, kept]
    return SHARES[kept[np.argmin(np.log(flown).mean(axis=0))] if len(flown) else kept[0]]
