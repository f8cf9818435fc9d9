"""By what a vehicle may differ from its file and still be the one that the file describes."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Stages, Term, predicted_residual
from np_drake.diagnosis.options import Tolerance
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.effects import (
    AttitudeLatency,
    CenterOfMassOffset,
    ClockOffset,
    ImuMounting,
    InertiaError,
    MassError,
    MixerGain,
    MotorLag,
    ThrottleCurve,
    ThrustScale,
    WeakRotor,
)
from np_drake.effects.base import Effect, Parameter, arm
from np_drake.estimation.priors import HEALTHY, stated
from np_drake.vehicle import Vehicle
from np_drake.vehicle.published import published_priors

ROTOR_NUMBERS = (1.0, 2.0, 3.0, 4.0)
PART = 0.2  # of a deviation at which a mass effect is differenced, as it is not quite linear [1]


@dc.dataclass(frozen=True)
class EffectPrior:
    """Standard deviations of parameters of an effect, by name [SI]; `fixed` ones have a value.

    at_value: the deviation is that of a coefficient of the effect at these values, which is not
    linear. about: values of the vehicle of the file, where they are not neutral. stated: whether
    the file states it, so that the effect takes its place and is a cause beyond it.
    """

    effect: type[Effect]
    sigma: dict[str, float]
    fixed: dict[str, float] = dc.field(default_factory=dict)
    at_value: bool = False
    about: dict[str, float] = dc.field(default_factory=dict)
    stated: bool = False

    @property
    def name(self) -> str:
        """Identifier of the effect, with what is fixed."""
        return self.effect.identifier + "".join(f"[{v:g}]" for v in self.fixed.values())

    @property
    def term(self) -> Term:
        """The effect of the vehicle of the file."""
        return Term(self.at(**self.about))

    def is_of(self, effect: Effect) -> bool:
        """Return whether it is of this effect, and of the same of what is fixed."""
        return type(effect) is self.effect and self.fixed.items() <= effect.values.items()

    def usual(self, p: Parameter) -> float:
        """Return the value of a parameter of the vehicle of the file."""
        return self.about.get(p.name, p.neutral)

    def at(self, **values: float) -> Effect:
        """Return the effect with these values, all other parameters neutral or fixed."""
        free = {p.name: p.neutral for p in self.effect.parameters if not p.choices}
        return self.effect.of({**free, **self.fixed, **values})


def file_priors(vehicle: Vehicle, tolerance: Tolerance) -> list[EffectPrior]:
    """Return by what every vehicle may differ from its file, with the standard deviations: mass,
    thrust, what its input leaves open, and of a measured vehicle what its intervals state.
    """
    effect_priors = [
        EffectPrior(ThrustScale, {"scale": tolerance.thrust}),
        EffectPrior(MassError, {"delta_mass": tolerance.mass * vehicle.mass}),
        EffectPrior(ThrottleCurve, {"curve": tolerance.throttle_curve}),
        EffectPrior(ClockOffset, {"offset": tolerance.timing}),
        EffectPrior(ImuMounting, dict.fromkeys(("roll", "pitch", "yaw"), tolerance.mounting)),
        EffectPrior(AttitudeLatency, {"latency": tolerance.latency}),
        *([] if tolerance.unmeasured else _stated(vehicle)),
    ]
    # What is certain differs by nothing.
    known = [
        dc.replace(d, sigma={name: sd for name, sd in d.sigma.items() if sd > 0})
        for d in effect_priors
    ]
    return [d for d in known if d.sigma]


def _stated(vehicle: Vehicle) -> list[EffectPrior]:
    """Return what the intervals of a file state; 0 where they state nothing."""
    torque = vehicle.known_within("torque_coefficient") or 0.0
    lag = vehicle.known_within("rotor_time_constant") or 0.0
    effect_priors = [
        *airframe_priors(vehicle, unmeasured=False),
        EffectPrior(MixerGain, {"yaw": torque / vehicle.torque_coefficient}),
        EffectPrior(
            MotorLag, {"time_constant": lag}, about={"time_constant": vehicle.rotor_time_constant}
        ),
    ]
    return [dc.replace(d, stated=True) for d in effect_priors]


def airframe_priors(vehicle: Vehicle, *, unmeasured: bool) -> list[EffectPrior]:
    """Return by what inertia, centre of mass and rotors differ from the file.

    Of a number for which the file states an interval, the deviation is that of the interval; of any
    other that of healthy vehicles where the vehicle is `unmeasured`, else 0.
    """

    def deviation(field: str, usual: float, *place: int) -> float:
        return stated(vehicle, field, usual if unmeasured else 0.0, *place)

    published = published_priors().inertia.deviation
    moments = {
        p.name: deviation("inertia", published * J, i, i) / J
        for i, (p, J) in enumerate(zip(InertiaError.parameters, vehicle.J.diagonal(), strict=True))
    }
    lengths = [HEALTHY.center_of_mass, HEALTHY.center_of_mass, HEALTHY.center_of_mass_height]
    center = {
        axis: deviation("calibration.center_of_mass", arm(vehicle) * length, i)
        for i, (axis, length) in enumerate(zip("xyz", lengths, strict=True))
    }
    gains = [deviation("calibration.rotor_gains", HEALTHY.rotor_gain, i) for i in range(4)]
    return [
        EffectPrior(InertiaError, moments),
        EffectPrior(CenterOfMassOffset, center),
        *(
            EffectPrior(WeakRotor, {"efficiency": gain}, {"rotor": rotor})
            for rotor, gain in zip(ROTOR_NUMBERS, gains, strict=True)
        ),
    ]


def columns_of(
    flight: FlightResiduals, effect_priors: Sequence[EffectPrior], part: float = PART
) -> np.ndarray:
    """Return columns (m, 15, k) of all parameters of deviations, of one standard deviation each.

    Args:
        part: of a deviation, at which a mass effect is differenced [1].
    """
    stages: Stages = {}
    out = []
    for d in effect_priors:
        parameters = {p.name: p for p in d.effect.parameters}
        for name, sigma in d.sigma.items():
            p = parameters[name]
            step = sigma * (part if d.effect.place == "mass" else 1.0)
            usual = d.usual(p)
            step = min(step, p.upper - usual) or max(-step, p.lower - usual)
            moved = Term(d.at(**{name: usual + step}))
            out.append(predicted_residual(flight, [moved], stages) * (sigma / step))
    return np.stack(out, axis=-1) if out else np.zeros((*flight.y.shape, 0))
