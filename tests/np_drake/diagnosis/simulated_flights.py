"""Simulated flights from a prescribed motion: the command is that with which the real dynamics
follow it.

Row by row, body rates change by the mean torque of an interval, specific force is that of the held
thrust and of the effects, and velocity and position are its sums. Every effect of the library can
act, from any time on.
"""

import dataclasses as dc
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import ndimage, signal
from scipy.interpolate import CubicSpline

from np_drake import attitude
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects.base import MassProperties, Measurement, Motion
from np_drake.effects.combine import EffectsByPlace, split_effects
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle

VEHICLE = Vehicle()
SWEEPS = 14  # fixed-point steps from motion to forces and back
STEERED = 5  # of them, in which the attitude still turns towards the force that is needed
STEP = 0.01  # of the log [s]
SLOW_START = 4.0  # [s]
GRAVITY = np.array([0.0, 0.0, VEHICLE.gravity])

#        frequency [Hz], amplitude [m, rad] of x, y, z, heading
WAVES = (
    (0.2, (1.0, 0.9, 0.3, 0.4)),
    (0.5, (0.2, 0.25, 0.1, 0.1)),
    (1.2, (0.02, 0.02, 0.015, 0.01)),
)


@dc.dataclass
class Course:
    """Desired motion on the rows: p, v, a (n, 3) in W and heading (n,)."""

    t: np.ndarray
    p: np.ndarray
    v: np.ndarray
    a: np.ndarray
    yaw: np.ndarray


def course(
    seed: int, seconds: float, vigour: float | tuple[float, ...], height: float = 1.2
) -> Course:
    """Return a few sinusoids on each axis about a point above the ground, starting from rest."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(round(seconds / STEP) + 1)
    parts = np.zeros((3, len(t), 4))
    for frequency, amplitude in WAVES:
        rate = 2 * np.pi * frequency * rng.uniform(0.9, 1.1, 4)
        angle = t[:, None] * rate + rng.uniform(0, 2 * np.pi, 4)
        size = np.multiply(vigour, amplitude)
        parts += np.stack(
            [size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)]
        )
    s = np.minimum(t / SLOW_START, 1.0)[:, None]
    grown = s**3 * (10 - 15 * s + 6 * s**2)
    rate = 30 * s**2 * (1 - s) ** 2 / SLOW_START
    bend = 60 * s * (1 - s) * (1 - 2 * s) / SLOW_START**2
    wave, slope, curve = parts
    p, v = grown * wave, grown * slope + rate * wave
    a = grown * curve + 2 * rate * slope + bend * wave
    return Course(t, p[:, :3] + [0, 0, height], v[:, :3], a[:, :3], p[:, 3])


@dc.dataclass
class Flown:
    """Resulting motion: x (n, 13), a (n, 3) right-sided, thrust (n, 4) at rows and as mean over
    each row's interval.
    """

    x: np.ndarray
    a: np.ndarray
    rows: np.ndarray
    mids: np.ndarray


class Flight:
    """Simulation of one flight under some effects."""

    def __init__(
        self,
        path: Course,
        places: EffectsByPlace,
        onset: Mapping[str, float],
        vehicle: Vehicle,
        loads: Mapping[float, float],
    ):
        self.path, self.places, self.onset, self.vehicle = path, places, onset, vehicle
        self.loads = loads
        self.lag = next((e for e in places.actuator if isinstance(e, MotorLag)), None)

    def gate(self, effect: Any) -> np.ndarray:
        """Return a step (n, 1) that is one from the effect's onset on."""
        return (self.path.t >= self.onset.get(effect.identifier, -np.inf))[:, None].astype(float)

    def flown(self) -> Flown:
        """Return the motion by fixed-point iteration: forces from motion, motion from forces."""
        path, n = self.path, len(self.path.t)
        self.m, self.c, self.J = self._mass_properties()
        thrust = np.full((n, 4), 0.25 * self.vehicle.mass * self.vehicle.gravity)
        now = Flown(
            np.concatenate([path.p, np.zeros((n, 4)), path.v, np.zeros((n, 3))], axis=1),
            path.a,
            thrust,
            thrust,
        )
        force, steered = np.zeros((n, 3)), np.zeros((n, 3))
        for i in range(SWEEPS):
            if i < STEERED:
                steered = ndimage.gaussian_filter1d(force, 0.06 / STEP, axis=0, mode="nearest")
                q, w, lift = self._attitude(steered)
            force, now = self._moved(now, q, w, lift)
        return now

    def _mass_properties(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        nominal = MassProperties.of(self.vehicle)
        n = len(self.path.t)
        m, c, J = np.full((n, 1), nominal.mass), np.zeros((n, 3)), np.tile(nominal.J, (n, 1, 1))
        for effect in self.places.mass:
            real, on = effect.properties(nominal), self.gate(effect)
            m, c = m + on * (real.mass - nominal.mass), c + on * real.p_BoBcm_B
            J = J + on[:, :, None] * (real.J - nominal.J)
        return m, c, J

    def _attitude(self, force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return attitude, body rates and thrust that follow the course under `force` (n, 3) in
        W.
        """
        mass = ndimage.gaussian_filter1d(self.m, 0.06 / STEP, axis=0, mode="nearest")
        needed = mass * (self.path.a + GRAVITY) - force
        lift = np.linalg.norm(needed, axis=1)
        q = attitude.quaternion_from_axes(needed / lift[:, None], self.path.yaw)
        rate = CubicSpline(self.path.t, q).derivative()(self.path.t)
        return q, 2 * attitude.multiply(q * [1.0, -1.0, -1.0, -1.0], rate)[:, 1:], lift

    def _moved(self, now: Flown, q, w, lift) -> tuple[np.ndarray, Flown]:
        """Return the effects' force in W at the rows, and the motion under it, after one
        iteration.
        """
        x = np.concatenate([now.x[:, :3], q, now.x[:, V], w], axis=1)
        al = np.diff(w, axis=0) / STEP
        al = np.concatenate([al, al[-1:]])
        chi_rows = self._chi(self.path.t, x, now.rows)
        chi_mids = self._chi(self.path.t + 0.5 * STEP, _middle(x), now.mids)
        mean = np.diff(now.x[:, V], axis=0) / STEP
        swing = self._payload(_middle(x), np.concatenate([mean, mean[-1:]]), al)
        chi_rows, chi_mids = chi_rows + _before(swing), chi_mids + swing
        q_mid, w_mid = _middle(x)[:, Q], _middle(x)[:, W]
        f_rows, f_mids = (
            attitude.rotate_back(i, chi[:, :3]) for i, chi in ((q, chi_rows), (q_mid, chi_mids))
        )
        f_mids[:, 2] += lift
        spin = np.cross(w_mid, np.einsum("nij,nj->ni", self.J, w_mid)) + np.einsum(
            "nij,nj->ni", self.J, al
        )
        torque = spin + np.cross(self.c, f_mids) - chi_mids[:, 3:]
        mids = np.concatenate([lift[:, None], torque], axis=1) @ self.vehicle.unmixer.T
        rows, mids = self._turned(mids)
        f_rows[:, 2] += rows.sum(axis=1)
        s_rows, s_mids = (
            f / self.m - np.cross(al, self.c) - np.cross(o, np.cross(o, self.c))
            for f, o in ((f_rows, w), (f_mids, w_mid))
        )
        a = attitude.rotate(q, s_rows) - GRAVITY
        v = self.path.v[0] + STEP * _sum(attitude.rotate(q_mid, s_mids) - GRAVITY)
        p = self.path.p[0] + STEP * _sum(_middle(v))
        return chi_rows[:, :3], Flown(np.concatenate([p, q, v, w], axis=1), a, rows, mids)

    def _chi(self, t: np.ndarray, x: np.ndarray, thrust: np.ndarray) -> np.ndarray:
        """Return the wrench (n, 6) of all wrench effects, each from its onset on."""
        wind = sum(e.air_velocity(t) * self.gate(e) for e in self.places.wrench) + np.zeros(
            (len(t), 3)
        )
        rate = np.zeros((len(t), 4))
        if self.lag:
            rate = np.gradient(
                np.sqrt(np.maximum(thrust, 0) / self.vehicle.thrust_coefficient), STEP, axis=0
            )
        motion = Motion(t, x, thrust, wind, rate)
        return sum(
            e.wrench(self.vehicle, motion) * self.gate(e) for e in self.places.wrench
        ) + np.zeros((len(t), 6))

    def _payload(self, x: np.ndarray, a: np.ndarray, al: np.ndarray) -> np.ndarray:
        """Return the mean wrench (n, 6) over each interval, from the motion in its middle.

        The payload begins at rest along the apparent gravity of its first half second.
        """
        payload, chi = self.places.payload, np.zeros((len(x), 6))
        if payload is None:
            return chi
        k = int(np.searchsorted(self.path.t, self.onset.get(payload.identifier, -np.inf)))
        down = -(a[k : k + 50].mean(axis=0) + GRAVITY)
        r = payload.length * down / np.linalg.norm(down)
        still = np.zeros(3)
        mass = np.full((len(x), 1), payload.mass)
        for time, load in self.loads.items():
            mass[self.path.t >= time] = load
        chi[k:] = payload.wrench_along(
            self.vehicle, x=x[k:], a=a[k:], al=al[k:], step=STEP, r=r, r_rate=still
        )
        return chi * mass / payload.mass

    def _turned(self, needed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return thrust (n, 4) at rows and in the mean: held over the interval, or interpolated
        where rotors lag.
        """
        if self.lag is None:
            return needed, needed
        rows = _before(needed)
        speed = np.sqrt(rows)
        later = np.concatenate([speed[1:], speed[-1:]])
        target = (later - self._decay(1.0) * speed) / (1 - self._decay(1.0))
        middle = target + (speed - target) * self._decay(0.5)
        return rows, (speed**2 + 4 * middle**2 + later**2) / 6

    def _decay(self, share: float) -> float:
        assert self.lag is not None
        return float(np.exp(-share * STEP / self.lag.time_constant))

    def command(self, now: Flown) -> np.ndarray:
        """Return u (n, 4) whose rotors, through the actuator effects, give the thrust that was
        flown [N, N·m].
        """
        thrust = now.mids
        for effect in reversed(self.places.actuator):
            if not effect.turns_rotor:
                gain = effect.thrust(self.vehicle, np.zeros(0), np.ones_like(thrust), self.path.t)
                thrust = thrust / (1 + self.gate(effect) * (gain - 1))
        if self.lag is not None:
            speed = np.sqrt(thrust * now.rows / now.mids)
            later = np.concatenate([speed[1:], speed[-1:]])
            thrust = ((later - self._decay(1.0) * speed) / (1 - self._decay(1.0))) ** 2
        early = round(sum(effect.dead_time for effect in self.places.actuator) / STEP)
        thrust = np.concatenate([thrust[early:], np.repeat(thrust[-1:], early, axis=0)])
        return thrust @ self.vehicle.mixer.T


def _middle(rows: np.ndarray) -> np.ndarray:
    """Return values (n, m) in the middle of the interval after each row; quaternions are
    normalised.
    """
    out = 0.5 * (rows + np.concatenate([rows[1:], rows[-1:]]))
    if out.shape[1] == 13:
        out[:, Q] /= np.linalg.norm(out[:, Q], axis=1, keepdims=True)
    return out


def _before(mids: np.ndarray) -> np.ndarray:
    """Return values (n, m) at the rows, from those in the middle of the intervals after them."""
    return 0.5 * (mids + np.concatenate([mids[:1], mids[:-1]]))


def gauss_markov(rng: np.random.Generator, t: np.ndarray, time: float) -> np.ndarray:
    """Return an exact first-order Gauss-Markov process (n, 3) of unit deviation; t: at equal
    steps.
    """
    decay = np.exp(-(t[1] - t[0]) / time)
    kicks = rng.standard_normal((len(t), 3))
    kicks[1:] *= np.sqrt(1 - decay**2)
    return signal.lfilter([1.0], [1.0, -decay], kicks, axis=0)


def knocked(e: FlightResiduals, *at: float) -> FlightResiduals:
    """Return the flight with outliers of two rows at these times."""
    first = np.searchsorted(e.t, at)
    return dc.replace(e, outliers=np.isin(np.arange(len(e.t)), [first, first + 1]))


def _sum(rates: np.ndarray) -> np.ndarray:
    """Return the cumulative sums (n, 3) before each row."""
    return np.concatenate([np.zeros((1, 3)), np.cumsum(rates[:-1], axis=0)])


def fly(
    *effects: Any,
    name: str = "a",
    seed: int = 0,
    seconds: float = 12.0,
    noise: float = 0.0,
    vigour: float | tuple[float, ...] = 1.0,
    accelerations: bool = True,
    onset: Mapping[str, float] | None = None,
    loads: Mapping[float, float] | None = None,
    attitude_noise: float = 0.0,
    height: float = 1.2,
    vehicle: Vehicle = VEHICLE,
) -> FlightLog:
    """Return the log of a flight under `effects`.

    onset: by identifier [s]. loads: by time [s], the mass of a payload from then on [kg].
    noise: factor on the white noise of the vehicle file [1];
    attitude_noise [rad]. height: of the start [m].
    vigour: of the motion along x, y, z and about z [1]; 0 hovers.
    """
    places = split_effects(effects)
    flight = Flight(
        course(seed, seconds, vigour, height), places, onset or {}, vehicle, loads or {}
    )
    flown = flight.flown()
    al = np.concatenate([np.diff(flown.x[:, W], axis=0) / STEP, np.zeros((1, 3))])
    reading = Measurement(flown.x, flown.a, al, np.zeros((len(al), 4)))
    for effect in places.measurement:
        reading = effect.measure(vehicle, reading, np.zeros((len(al), 0)))
    white = MeasurementNoise(**{k: noise * v for k, v in dc.asdict(MeasurementNoise()).items()})
    sensors = SensorNoise(dc.replace(white, attitude=attitude_noise))
    reading = sensors.measure(
        vehicle, reading, np.random.default_rng(1000 + seed).normal(size=(len(al), 22))
    )
    late = round(sum(getattr(e, "clock_shift", 0.0) for e in places.measurement) / STEP)
    first, last = max(0, -late), len(al) + min(0, -late)
    x, a = reading.x[first + late : last + late], reading.a[first + late : last + late]
    return FlightLog(
        t=flight.path.t[first:last],
        p=x[:, P],
        q=x[:, Q],
        v=x[:, V],
        w=x[:, W],
        u=flight.command(flown)[first:last],
        a=a if accelerations else None,
        name=name,
    )
