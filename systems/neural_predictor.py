"""The Neural Predictor as a LeafSystem."""

from pydrake.common.value import Value

from np_drake.residual_model import Memory
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.vehicle import Vehicle
from systems.residual_predictor import ResidualPredictor


class NeuralPredictor(ResidualPredictor):
    """Neural Predictor in the loop, z+ = A z + B zeta, chi_hat = C z, for any configuration.

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

    State: a discrete group each for z and window, whose indices are public, as in
    `context.get_discrete_state(predictor.z_index).value()`; likewise, sorted by name, what else the
    model keeps (see its class): low-pass and count; A, B and rows of a refit, or theta and energy of
    a network; then chi_hat (6).
    Event: periodic, every `model.step`. Before the window is full, on NaN and on dropped samples:
    see the model.

    Args:
        model: of any configuration.
        horizon, stride, vehicle: as of `ResidualPredictor`.
    """  # noqa: E501

    def __init__(
        self,
        model: LiftedLinearPredictor,
        *,
        horizon: int,
        stride: int,
        vehicle: Vehicle | None = None,
    ):
        super().__init__(model, horizon=horizon, stride=stride, vehicle=vehicle)
        self._np = model
        self.DeclareAbstractOutputPort(
            "lifted_linear_system", Value[object], self._calc_system, {self.xd_ticket()}
        )

    def _declare_memory(self, initial: Memory) -> None:
        self.z_index = self._declare_group("z", initial)  # (K,) lifted vector
        # (W, 12) last [chi, zeta], oldest first
        self.window_index = self._declare_group("window", initial)
        super()._declare_memory(initial)

    def _calc_system(self, context, output) -> None:
        output.set_value(self._np.system(self.memory(context)))
