"""The Neural Predictor as a LeafSystem."""

from pydrake.common.value import Value

from np_drake.lifting.lifted_linear_system import LiftedLinearSystem
from np_drake.residual_models.neural_predictor import NeuralPredictor as NeuralPredictorModel
from systems.residual_predictor import ResidualPredictor


class NeuralPredictor(ResidualPredictor):
    """z = Phi(chi), z+ = A z + B zeta, chi_hat = C z in the loop, A and B as refit on the window.

    .. pydrake_system::

        name: NeuralPredictor
        input_ports:
        - x
        - u
        - label
        output_ports:
        - forecast
        - chi_hat
        - lifted_linear_system

    | port | size | meaning | unit |
    |---|---|---|---|
    | x, u, label | 13, 4, 6 | as `ResidualPredictor` | |
    | forecast | WrenchForecast | A, B, C and z at the MPC's step, with the sample at hand; feeds through | |
    | chi_hat | 6 | the forecast's first wrench, as of the last event | N, N·m |
    | lifted_linear_system | LiftedLinearSystem | A, B, C at the predictor's own step, as of the last event | |

    State, one discrete group each, sorted by name: A (K²), B (6 K), count, dropped, gap, labels (1 each), lowpass (6),
    window (40 samples of chi and zeta, or as many as the encoder reads), z (K); then chi_hat (6).
    Event: periodic, every `model.step`. Before the window is full, on NaN and on dropped samples: see the model.
    """

    def __init__(self, model: NeuralPredictorModel, *, horizon: int, stride: int):
        super().__init__(model, horizon=horizon, stride=stride)
        self._C = model.model.system.C
        self.DeclareAbstractOutputPort(
            "lifted_linear_system", Value[object], self._calc_system, {self.xd_ticket()}
        )

    def _calc_system(self, context, output) -> None:
        memory = self.memory(context)
        output.set_value(LiftedLinearSystem(memory["A"], memory["B"], self._C, self._model.step))
