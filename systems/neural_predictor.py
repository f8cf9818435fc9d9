"""The Neural Predictor as a LeafSystem."""

from pydrake.common.value import Value

from np_drake.residual_models.neural_predictor import NeuralPredictor as NeuralPredictorModel
from np_drake.vehicle import Vehicle
from systems.residual_predictor import ResidualPredictor


class NeuralPredictor(ResidualPredictor):
    """Neural Predictor in the loop, z = Phi(chi) or E window, z+ = A z + B zeta, chi_hat = C z, for any configuration.

    .. pydrake_system::

        name: NeuralPredictor
        input_ports:
        - x
        - u
        - label
        - sent
        - delay
        output_ports:
        - forecast
        - chi_hat
        - lifted_linear_system

    | port | size | meaning | unit |
    |---|---|---|---|
    | x, u, label | 13, 4, 6 | as `ResidualPredictor` | |
    | sent, delay | 4 KEPT, 1 | as `ResidualPredictor`, where `vehicle` is given | N, N·m, s |
    | forecast | WrenchForecast | A, B, C and z at the MPC's step, with the sample at hand; feeds through | |
    | chi_hat | 6 | the forecast's first wrench, `delay` later, as of the last event | N, N·m |
    | lifted_linear_system | LiftedLinearSystem | A, B, C at the predictor's own step, as of the last event | |

    State, in one discrete group, sorted by name: A (K²) and B (6 K) where they are refit, count, dropped, gap, labels
    (1 each), lowpass (6), rows (the window, lifted) where there is a refit, where the model has a trust its groups,
    window (as many samples of chi and zeta as encoder or refit read), z (K); in another chi_hat (6).
    Event: periodic, every `model.step`. Before the window is full, on NaN and on dropped samples: see the model.
    """

    def __init__(
        self, model: NeuralPredictorModel, *, horizon: int, stride: int, vehicle: Vehicle | None = None
    ):
        super().__init__(model, horizon=horizon, stride=stride, vehicle=vehicle)
        self._np = model
        self.DeclareAbstractOutputPort(
            "lifted_linear_system", Value[object], self._calc_system, {self.xd_ticket()}
        )

    def _calc_system(self, context, output) -> None:
        output.set_value(self._np.system(self.memory(context)))
