"""Recording of signals for flight logs, just after each sampling instant."""

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, ZeroOrderHold

# Row k of a log carries the command that acts from t_k on, and the acceleration under it. Events at
# t_k have run a microsecond later, and nothing else has moved.
_AFTER = 1e-6  # [s]


class Recorder(Multiplexer):
    """Signals side by side in one vector, behind which a hold and a log follow.

    It has an input of each signal, in their order.
    """

    def __init__(self, sizes: dict[str, int], *, period: float):
        """Declare ports.

        Args:
            sizes: of the signals by name.
            period: sampling time [s].
        """
        super().__init__(list(sizes.values()))
        self._period = period
        self._sizes = sizes

    def read(self, diagram: Diagram, context: Context) -> dict[str, np.ndarray]:
        """Return {"t": (n,) [s], name: (n, size)}: row k is what held just after t_k = k * period.

        Args:
            diagram: that the recorder is a direct subsystem of.
            context: the root context of the simulation so far.
        """
        log = diagram.GetSubsystemByName("record").FindLog(context)
        # The hold passes row k on at t_(k+1), before it samples again; the first entry is its
        # initial value.
        data = log.data().T[1:]
        parts = np.split(data, np.cumsum([*self._sizes.values()])[:-1], axis=1)
        rows = dict(zip(self._sizes, parts, strict=True))
        return {"t": self._period * np.arange(len(data)), **rows}


def add_recorder(
    builder: DiagramBuilder, signals: dict[str, OutputPort], *, period: float
) -> Recorder:
    """Add one log of signals and return its subsystem `recorder`.

    Args:
        builder: of the diagram that is recorded.
        signals: vector ports by name.
        period: between samples [s].
    """
    sizes = {name: port.size() for name, port in signals.items()}
    recorder = builder.AddNamedSystem("recorder", Recorder(sizes, period=period))
    hold = builder.AddNamedSystem(
        "recorder_hold", ZeroOrderHold(period, sum(sizes.values()), _AFTER)
    )
    for place, port in enumerate(signals.values()):
        builder.Connect(port, recorder.get_input_port(place))
    builder.Connect(recorder.get_output_port(), hold.get_input_port())
    LogVectorOutput(hold.get_output_port(), builder, period).set_name("record")
    return recorder
