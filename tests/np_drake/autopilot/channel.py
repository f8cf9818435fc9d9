"""Link in memory, and messages that only tests send."""

import numpy as np

from np_drake import attitude
from np_drake.autopilot.mavlink import Codec, turned_attitude
from np_drake.logs.importing.log_map import FRD_TO_FLU, NED_TO_ENU
from np_drake.rigid_body import P, Q, V, W


class Channel:
    """End of a link in memory; `passes` returns when what is sent at a time arrives [s]."""

    def __init__(self, clock, passes):
        self._clock, self._passes = clock, passes
        self._under_way: list[tuple[float, bytes]] = []
        self.other = self

    @classmethod
    def pair(cls, clock, passes) -> "tuple[Channel, Channel]":
        one, other = cls(clock, passes), cls(clock, passes)
        one.other, other.other = other, one
        return one, other

    def send(self, data: bytes) -> None:
        arrives = self._passes(self._clock())
        if arrives < np.inf:
            self.other._under_way.append((arrives, data))

    def receive(self) -> list[bytes]:
        """Return what has come since the last call, in the order of arrival."""
        now = self._clock()
        come = sorted((m for m in self._under_way if m[0] <= now), key=lambda m: m[0])
        self._under_way = [m for m in self._under_way if m[0] > now]
        return [data for _, data in come]


def local_position(codec: Codec, stamp: float, x: np.ndarray) -> bytes:
    """Return the state (13,) as LOCAL_POSITION_NED and ATTITUDE_QUATERNION."""
    ms, out = round(1e3 * stamp), codec._out
    where = out.local_position_ned_encode(ms, *NED_TO_ENU @ x[P], *NED_TO_ENU @ x[V])
    turned = out.attitude_quaternion_encode(ms, *turned_attitude(x[Q]), *FRD_TO_FLU * x[W])
    return codec._pack(where) + codec._pack(turned)


def states(st, arrays):
    """Hypothesis strategy of states (13,)."""
    vectors, turns = (arrays(float, 3, elements=st.floats(-a, a)) for a in (20, 3))
    return st.builds(
        lambda p, turn, v, w: np.concatenate([p, attitude.from_rotation_vector(turn), v, w]),
        vectors,
        turns,
        vectors,
        turns,
    )
