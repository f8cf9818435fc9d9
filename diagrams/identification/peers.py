"""Study `peers`: identification beside mujoco.sysid and aeroid on the same simulated flights.

All know geometry and mass, and tell thrust coefficient, inertia, torque, centre of mass and drag.
What they tell predicts a flight that none has seen. Peers read rates and rotor speed smoothed, for
neither models noise of its inputs.
"""

import contextlib
import dataclasses as dc
import io
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Annotated, Any

import numpy as np
import pandas as pd
from typer import Option

from diagrams.batch.run import Case, Report, Run, failures, require_result
from diagrams.identification.simulated import draw_and_fly
from np_drake import attitude
from np_drake.files.number_text import NOTHING
from np_drake.flight_log import FlightLog
from np_drake.identification.identify import Identification, identify
from np_drake.identification.signals import G
from np_drake.identification.validation import adapted, predict, vehicle_values
from np_drake.training_data.accelerations import most_likely
from np_drake.training_data.segments import white_noise
from np_drake.vehicle import Vehicle

SURE = 1.96  # standard deviations of a 95 % interval
STEP = 0.01  # of the logs that peers read [s]; own choice: that of the sensors
WINDOW, EVERY = 0.2, 0.5  # simulations of mujoco.sysid, and between their starts [s]; own choice
READ = 10.0  # beginning of the flight that aeroid reads, which it filters in Python [s]
ITERATIONS = 20
FLIGHTS = 3  # that are fitted
HORIZON = 0.5  # of the prediction of the held-out flight [s]
# White noise that the logs have, and what a model of no gusts may lack: of velocity [m/s], angles
# [rad], rates [rad/s], accelerations [m/s², rad/s²].
NOISE = {"velocity": 0.02, "angle": 0.003, "rate": 0.02, "force": 0.3, "torque": 1.0}
# What is told, over what the owner of the vehicle believes; centre of mass and drag: over the mean
# arm, and in 1/s.
NAMES = ("thrust", "jxx", "jyy", "jzz", "torque", "com_x", "com_y", "drag")
START = dict(zip(NAMES, (1.0, 1.0, 1.0, 1.0, 1.0, 0.01, 0.01, 0.15), strict=True))
LOW = dict(zip(NAMES, (0.3, 0.3, 0.3, 0.3, 0.1, -0.1, -0.1, 0.0), strict=True))
HIGH = dict(zip(NAMES, (3.0, 5.0, 5.0, 5.0, 5.0, 0.1, 0.1, 2.0), strict=True))
SHARES = NAMES[:5]  # whose error is a share of the truth
Told = tuple[dict[str, float], dict[str, float]]  # values and standard deviations, of `NAMES`


def vehicle_of(known: Vehicle, told: Mapping[str, float]) -> Vehicle:
    """Return the vehicle with what a peer tells."""
    arm = float(np.linalg.norm(known.rotor_positions, axis=1).mean())
    moments = np.diag(known.J) * [told["jxx"], told["jyy"], told["jzz"]]
    center = [arm * told["com_x"], arm * told["com_y"], 0.0]
    coefficient = known.thrust_coefficient * told["thrust"]
    lever = known.torque_coefficient / known.thrust_coefficient * told["torque"]
    return dc.replace(
        known,
        inertia=np.diag(moments).tolist(),
        thrust_coefficient=coefficient,
        torque_coefficient=lever * coefficient,
        calibration=dc.replace(known.calibration, center_of_mass=center),
    )


def truth_of(vehicle: Vehicle, drag: float, known: Vehicle) -> dict[str, float]:
    """Return the true values of `NAMES`."""
    arm = float(np.linalg.norm(known.rotor_positions, axis=1).mean())
    moments = np.diag(vehicle.J) / np.diag(known.J)
    x, y, _ = vehicle.calibration.center_of_mass
    thrust = vehicle.thrust_coefficient / known.thrust_coefficient
    lever = vehicle.torque_coefficient / known.torque_coefficient / thrust
    return dict(zip(NAMES, (thrust, *moments, lever, x / arm, y / arm, drag), strict=True))


def read(log: FlightLog, seconds: float = np.inf) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times (n,) [s], states (n, 13) and rotor speeds (n, 4) [rad/s] at even times."""
    t = np.arange(log.t[0], min(log.t[-1], log.t[0] + seconds), STEP)
    x, rotor = (
        np.stack([np.interp(t, log.t, column) for column in np.asarray(values).T], axis=1)
        for values in (log.x, log.rotor)
    )
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    # Neither peer models noise of the state that it starts from, or of its inputs.
    x[:, 10:13] = most_likely(x[:, 10:13], white_noise([x[:, 10:13]]), STEP)
    rotor = most_likely(rotor, white_noise([rotor]), STEP)
    return t - t[0], x, rotor


def by_np_drake(logs: Sequence[FlightLog], known: Vehicle) -> tuple[Told, Identification]:
    """Return what np_drake tells."""
    found = identify(logs, known, mass=known.mass)
    arm = float(np.linalg.norm(known.rotor_positions, axis=1).mean())
    moments = np.diag(known.J)
    lever = known.torque_coefficient / known.thrust_coefficient
    names = [f"inertia {axis}{axis}" for axis in "xyz"]
    names = ["thrust coefficient", *names, "torque over thrust"]
    names += ["centre of mass x", "centre of mass y", "drag, lateral"]
    units = (known.thrust_coefficient, *moments, lever, arm, arm, 1.0)
    values, deviations = {}, {}
    for name, of, unit in zip(NAMES, names, units, strict=True):
        values[name] = found[of].value / unit
        deviations[name] = (found[of].high - found[of].low) / (2 * SURE * unit)
    return (values, deviations), found


def by_mujoco(logs: Sequence[FlightLog], known: Vehicle) -> Told:
    """Return what mujoco.sysid tells of simulations of 0.2 s from logged states on."""
    from mujoco import MjSpec, sysid  # type: ignore[attr-defined]

    arm = float(np.linalg.norm(known.rotor_positions, axis=1).mean())
    lever = known.torque_coefficient / known.thrust_coefficient
    sites = "".join(
        f'<site name="r{i}" pos="{x} {y} {z}"/>'
        for i, (x, y, z) in enumerate(known.rotor_positions)
    )
    motors = "".join(f'<motor name="m{i}" site="r{i}" gear="0 0 1 0 0 1"/>' for i in range(4))
    sensors = "".join(
        f'<{kind} name="{kind}" objtype="xbody" objname="b"/>'
        if kind.startswith("frame")
        else f'<{kind} name="{kind}" site="o"/>'
        for kind in ("framelinvel", "framequat", "gyro")
    )
    spec = MjSpec.from_string(
        f'<mujoco><option timestep="0.005" gravity="0 0 {-G}" integrator="RK4"/><worldbody>'
        f'<body name="b"><freejoint/><inertial pos="0 0 0" mass="{known.mass}" '
        f'diaginertia="{" ".join(map(str, np.diag(known.J)))}"/><site name="o"/>{sites}</body>'
        f"</worldbody><actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>"
    )

    def apply(spec: Any, parameter: Any) -> None:
        told = dict(zip(NAMES, parameter.value, strict=True))
        body = spec.body("b")
        body.inertia = np.diag(known.J) * [told["jxx"], told["jyy"], told["jzz"]]
        body.ipos = [arm * told["com_x"], arm * told["com_y"], 0.0]
        for i, turn in enumerate(known.rotor_directions):
            push = known.thrust_coefficient * told["thrust"]
            spec.actuator(f"m{i}").gear = [0, 0, push, 0, 0, push * lever * told["torque"] * turn]
        # The viscosity of its fluid is a linear drag: 3 pi eta d of a sphere.
        size = np.sqrt(1.5 * np.trace(known.J) / known.mass)
        spec.option.viscosity = told["drag"] * known.mass / (3 * np.pi * size)

    start, low, high = (np.array([of[name] for name in NAMES]) for of in (START, LOW, HIGH))
    parameters = sysid.ParameterDict()
    parameters.add(sysid.Parameter("all", start, low, high, modifier=apply))
    model = spec.compile()
    states, controls, readings = [], [], []
    rows, apart = round(WINDOW / STEP) + 1, round(EVERY / STEP)
    for log in logs:
        t, x, rotor = read(log)
        # MuJoCo's free joint: velocity of the body's origin in W, rates in B.
        for first in range(0, len(t) - rows, apart):
            part = slice(first, first + rows)
            own = t[part] - t[first]
            states.append(sysid.create_initial_state(model, x[first, :7], x[first, 7:]))
            controls.append(sysid.TimeSeries.from_control_names(own, rotor[part] ** 2, model))
            seen = np.concatenate([x[part, 7:10], x[part, 3:7], x[part, 10:13]], axis=1)
            readings.append(sysid.TimeSeries.from_names(own, seen, model))
    names = [str(i) for i in range(len(states))]
    sequences = sysid.ModelSequences("flights", spec, names, states, controls, readings)
    residual = sysid.build_residual_fn(models_sequences=[sequences], n_threads=1)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints each iteration
        # A step of 1e-8 moves a centre of mass by less than MuJoCo tells from the origin.
        found, result = sysid.optimize(
            parameters, residual, verbose=False, max_iters=ITERATIONS, eps=1e-4
        )
    left = residual(result.x, found)[0]
    covariance, _ = sysid.calculate_intervals(left, result.jac)
    values, deviations = result.x.tolist(), np.sqrt(np.diag(covariance)).tolist()
    return dict(zip(NAMES, values, strict=True)), dict(zip(NAMES, deviations, strict=True))


def by_aeroid(logs: Sequence[FlightLog], known: Vehicle) -> Told:
    """Return what aeroid tells by filter error of the beginning of the first flight."""
    import aeroid

    arm = float(np.linalg.norm(known.rotor_positions, axis=1).mean())
    lever = known.torque_coefficient / known.thrust_coefficient
    J, m = np.diag(known.J), known.mass
    positions, turns = np.array(known.rotor_positions), np.array(known.rotor_directions)
    t, x, rotor = read(logs[0], READ)
    R = attitude.rotation_matrix(x[:, 3:7])
    pitch, roll = -np.arcsin(R[:, 2, 0]), np.arctan2(R[:, 2, 1], R[:, 2, 2])
    states = ("u", "v", "w", "roll", "pitch", "p", "q", "r")
    controls = ("f1", "f2", "f3", "f4")

    def dynamics(_: float, z: np.ndarray, f: np.ndarray, told: Mapping[str, float]) -> list[float]:
        push = known.thrust_coefficient * told["thrust"] * f
        jx, jy, jz = J[0] * told["jxx"], J[1] * told["jyy"], J[2] * told["jzz"]
        u, v, w, roll, pitch, p, q, r = z
        dx, dy = -arm * told["com_x"], -arm * told["com_y"]
        drag = told["drag"]
        sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        L = push @ (positions[:, 1] + dy)
        M = -push @ (positions[:, 0] + dx)
        N = lever * told["torque"] * (push @ turns)
        return [
            r * v - q * w + G * sp - drag * u,
            p * w - r * u - G * cp * sr - drag * v,
            q * u - p * v - G * cp * cr + push.sum() / m - drag * w,
            p + (q * sr + r * cr) * sp / cp,
            q * cr - r * sr,
            (L + (jy - jz) * q * r) / jx,
            (M + (jz - jx) * p * r) / jy,
            (N + (jx - jy) * p * q) / jz,
        ]

    model = aeroid.Model(states, controls, START, dynamics)
    velocity = attitude.rotate_back(x[:, 3:7], x[:, 7:10])
    columns = np.column_stack([velocity, roll, pitch, x[:, 10:13]])
    channels = dict(zip(states, columns.T, strict=True))
    channels |= dict(zip(controls, rotor.T**2, strict=True))
    kinds = ("velocity",) * 3 + ("angle",) * 2 + ("rate",) * 3
    lacks = ("force",) * 3 + ("angle",) * 2 + ("torque",) * 3
    seen = {s: NOISE[kind] ** 2 for s, kind in zip(states, kinds, strict=True)}
    missed = {s: STEP * NOISE[kind] ** 2 for s, kind in zip(states, lacks, strict=True)}
    found = aeroid.identify(
        model,
        aeroid.FlightData(t, channels),
        NAMES,
        method="filter_error",
        process_noise=missed,
        measurement_noise=seen,
        bounds={name: (LOW[name], HIGH[name]) for name in NAMES},
    )
    return dict(found.parameters), dict(found.stderr)


PEERS: dict[str, tuple[str, Callable[[Sequence[FlightLog], Vehicle], Told]]] = {
    "mujoco.sysid": ("mujoco", by_mujoco),
    "aeroid": ("aeroid", by_aeroid),
}


def compared(case: Case, *, seconds: float) -> dict[str, Any]:
    """Return what each model tells of the vehicle of a case {"seed"}, flown for `seconds` [s] a
    flight: error and interval of every parameter, open-loop errors of a flight that is not fitted,
    processor time.

    Raises: FailedRun: if no vehicle of this seed can be flown.
    """
    truth, logs, _ = draw_and_fly(case["seed"], "rotor_speed", FLIGHTS + 1, seconds)
    *fitted, held = logs
    known, mass = truth.known, truth.vehicle.mass
    true = truth_of(truth.vehicle, truth.drag.d_x / mass, known)
    begin = time.process_time()
    own, found = by_np_drake(fitted, known)
    told: dict[str, Told] = {"np_drake": own}
    spent = {"np_drake": time.process_time() - begin}
    for name, (_, ask) in PEERS.items():
        begin = time.process_time()
        told[name] = ask(fitted, known)
        spent[name] = time.process_time() - begin
    told["vehicle file"] = (
        dict.fromkeys(NAMES, 1.0) | {"com_x": 0.0, "com_y": 0.0, "drag": 0.0},
        {},
    )
    rows = {"np_drake": found.estimate.layout.values(found.estimate.z)}
    fixed, frame = rows["np_drake"], found.basis.frame
    for name in ("vehicle file", *PEERS):
        values, _ = told[name]
        vehicle = vehicle_of(known, values)
        rows[name] = vehicle_values(vehicle, frame, found.basis.drive, mass, fixed)
        rows[name] |= {"drag": values["drag"], "climb": values["drag"]}
    model, adjusted = adapted(found, held, (0.0, 1.0), rows)
    lines = []
    for name, v in adjusted.items():
        values, deviations = told[name]
        _, errors = predict(model, held, v, seconds=HORIZON)
        lines.append(
            {
                "model": name,
                "error": {
                    n: abs(values[n] - true[n]) / (abs(true[n]) if n in SHARES else 1.0)
                    for n in NAMES
                },
                "inside": [abs(values[n] - true[n]) <= SURE * d for n, d in deviations.items()],
                "open_loop": np.median(errors[-1], axis=0).tolist(),
                "processor_time": spent.get(name),
            }
        )
    return {"lines": lines}


SHOWN = {  # column of the table: parameters, and its unit over that of the errors
    "thrust %": (("thrust",), 100.0),
    "Jxx, Jyy %": (("jxx", "jyy"), 100.0),
    "Jzz %": (("jzz",), 100.0),
    "torque %": (("torque",), 100.0),
    "centre % arm": (("com_x", "com_y"), 100.0),
    "drag 1/s": (("drag",), 1.0),
}


def run(
    run: Run,
    vehicles: Annotated[int, Option(min=1, max=1000, help="Simulated vehicles.")] = 6,
    seconds: Annotated[float, Option(min=10.0, max=600.0, help="Length of a flight [s].")] = 30.0,
) -> Report:
    """Identification beside mujoco.sysid and aeroid (extra `peers`); minutes a vehicle.

    --out DIR: cases to resume from.
    """
    for name, (module, _) in PEERS.items():
        if find_spec(module) is None:
            raise ValueError(f"peers: {name} is not installed: pip install 'np_drake[peers]'.")
    cases = [{"seed": run.seed + number} for number in range(vehicles)]
    work = partial(compared, seconds=seconds)
    records = run.cases("identifying", "vehicles", work, cases, config={"seconds": seconds})
    require_result(records)
    lines = [line for r in records if "result" in r for line in r["result"]["lines"]]
    table = []
    for name, own in pd.DataFrame(lines).groupby("model", sort=False):
        errors = pd.DataFrame(own["error"].tolist())
        inside = [within for of in own["inside"] for within in of]
        ahead = np.median(np.array(own["open_loop"].tolist()), axis=0)
        row = [f"{unit * np.median(errors[[*of]]):.2g}" for of, unit in SHOWN.values()]
        row.append(f"{100 * np.mean(inside):.0f} %" if inside else NOTHING)
        row += [f"{100 * ahead[1]:.2g}", f"{ahead[3]:.2g}"]
        cost = own["processor_time"].median()
        table.append((name, *row, NOTHING if np.isnan(cost) else f"{cost:.0f}"))
    title = (
        f"median errors; inside: truth in the 95 % interval; cm/s, rad/s: of a held-out flight, "
        f"{HORIZON:g} s open loop; s: processor; {vehicles} vehicles, {FLIGHTS} x {seconds:g} s, "
        f"seeds {run.seed} … {run.seed + vehicles - 1}"
    )
    header = ["model", *SHOWN, "inside", "cm/s", "rad/s", "s"]
    return Report(
        [(title, header, table)],
        config={"vehicles": vehicles, "seconds": seconds},
        metrics={"runs": records},
        notes=failures(records),
    )
