"""Recording of signals for flight logs, just after each sampling instant."""

import dataclasses as dc

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, VectorLogSink, ZeroOrderHold

# Row k of a log carries the command that acts from t_k on, and the acceleration under it. Events at t_k have run
# a microsecond later, and nothing else has moved.
_AFTER = 1e-6  # [s]


@dc.dataclass
class Recorder:
    """Log sink with the place of each named signal in it.

    sink: the log.   slices: signal name -> columns.   period: sampling time [s].
    """

    sink: VectorLogSink
    slices: dict[str, slice]
    period: float  # [s]

    def read(self, diagram: Diagram, context: Context) -> dict[str, np.ndarray]:
        """Return {"t": (n,) [s], name: (n, size)}: row k is what held just after t_k = k * period.

        Args: context: the root context of the finished simulation.
        """
        log = self.sink.FindLog(context)
        # The hold passes row k on at t_(k+1), before it samples again; the first entry is its initial value.
        data = log.data().T[1:]
        rows = {name: data[:, where] for name, where in self.slices.items()}
        return {"t": self.period * np.arange(len(data)), **rows}


def add_recorder(builder: DiagramBuilder, signals: dict[str, OutputPort], *, period: float) -> Recorder:
    """Add one log of all `signals` (vector ports), sampled every `period` [s]; name: recorder."""
    sizes = [port.size() for port in signals.values()]
    ends = np.cumsum([0] + sizes)
    slices = {name: slice(a, b) for name, a, b in zip(signals, ends[:-1], ends[1:], strict=True)}
    mux = builder.AddNamedSystem("recorder_mux", Multiplexer(sizes))
    hold = builder.AddNamedSystem("recorder_hold", ZeroOrderHold(period, int(ends[-1]), _AFTER))
    for i, port in enumerate(signals.values()):
        builder.Connect(port, mux.get_input_port(i))
    builder.Connect(mux.get_output_port(), hold.get_input_port())
    sink = LogVectorOutput(hold.get_output_port(), builder, period)
    sink.set_name("recorder")
    return Recorder(sink, slices, period)
