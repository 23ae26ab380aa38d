"""Compares the FMUs of the twin, run by three importers, with `offbd scene`. See scripts/fmu."""

import ctypes
import json
import shutil
import subprocess
import sys
from contextlib import contextmanager
from csv import DictReader
from math import pi, sin
from pathlib import Path

import ecospy
import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

PROGRAM, LIBRARY, DATA = sys.argv[1], sys.argv[2], Path(sys.argv[3])
# The plate of the FMU has no rim, that of the simulated rig has one beyond this, m.
BEFORE_THE_RIM = 0.15
VERSIONS = ["2.0", "3.0"]
BALL = ["x", "y", "vx", "vy"]
BALL_AND_PLATE = [*BALL, "qx", "qy"]
# Servos that are at once where they should be.
IDEAL = {
    f"{axis}_servo.{name}": value
    for axis in "xy"
    for name, value in {"lag": 0, "dead_time": 0, "rate_limit": 1000, "angle_limit": 1}.items()
}


def offbd(*arguments, status=0):
    run = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=DATA)
    assert run.returncode == status, f"offbd {arguments}: {run.returncode}\n{run.stderr}"
    return run


def export(name, *arguments):
    offbd("export", "fmu", "--library", LIBRARY, "-o", name, *arguments)
    return DATA / name


def scene(name, step, *arguments, **content):
    """Returns the rows of the scene, one for each step."""
    (DATA / f"{name}.json").write_text(json.dumps({"name": name, "edges": False, **content}))
    offbd("scene", f"{name}.json", "--model", "rolling", "--sample", step, "-o", name, *arguments)
    return columns(DATA / name / "trajectory.csv", "x_m", "y_m", "vx_m_s", "vy_m_s")


def columns(path, *names):
    """Returns the rows of a CSV file, with these columns; None where there is no number."""
    with open(path) as file:
        return [[float(row[name]) if row[name] else None for name in names] for row in DictReader(file)]


def free_run(name, longest_step, asset):
    """Returns ball and plate of the twin under the commands of the session, for each sample."""
    step = ["--step", longest_step]
    offbd("scene", "--commands", f"{name}.csv", "--asset", asset, *step, "-o", f"{name}-run")
    angles = ["qx_rad", "qy_rad"]
    path = DATA / f"{name}-run" / "trajectory.csv"
    return columns(path, "x_m", "y_m", "vx_m_s", "vy_m_s", *angles)


class Twin3:
    """An FMU of FMI 3.0 in FMPy."""

    def __init__(self, model, directory, log):
        self.slave = FMU3Slave(**slave_arguments(model, directory, model.instantiationToken))
        self.slave.instantiate(logMessage=log and (lambda *words: log(words[-1].decode())))
        self.set, self.get = self.slave.setFloat64, self.slave.getFloat64
        self.save, self.restore = self.slave.getFMUState, self.slave.setFMUState
        self.free, self.to_bytes = self.slave.freeFMUState, self.slave.serializeFMUState
        self.of_bytes = self.slave.deserializeFMUState
        # A function for what the model does not have.
        self.get_integer, self.not_offered = self.slave.getInt32, "fmi3GetInt32"

    def start(self):
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()


class Twin2:
    """An FMU of FMI 2.0 in FMPy."""

    def __init__(self, model, directory, log):
        self.slave = FMU2Slave(**slave_arguments(model, directory, model.guid))
        self.slave.instantiate(callbacks=log and self.callbacks(log))
        self.set, self.get = self.slave.setReal, self.slave.getReal
        self.save, self.restore = self.slave.getFMUstate, self.slave.setFMUstate
        self.free, self.to_bytes = self.slave.freeFMUstate, self.slave.serializeFMUstate
        self.of_bytes = self.slave.deSerializeFMUstate
        self.get_integer, self.not_offered = self.slave.getInteger, "fmi2GetInteger"

    def callbacks(self, log):
        """The logger of an importer, which fills in the message as `printf` does."""

        def logger(_environment, instance, status, category, message):
            assert (instance, status, category) == (b"twin", 3, b"logStatusError")
            text = ctypes.create_string_buffer(1000)
            ctypes.CDLL(None).snprintf(text, ctypes.c_size_t(len(text)), message)
            log(text.value.decode())

        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(logger)
        return callbacks

    def start(self):
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()


def slave_arguments(model, directory, token):
    identifier = model.coSimulation.modelIdentifier
    return {"guid": token, "unzipDirectory": directory, "modelIdentifier": identifier, "instanceName": "twin"}


class Twin:
    """An FMU in FMPy, with its variables by name."""

    def __init__(self, fmu, directory, log):
        self.model = fmpy.read_model_description(fmu)
        self.references = {v.name: v.valueReference for v in self.model.modelVariables}
        of_version = {"2.0": Twin2, "3.0": Twin3}[self.model.fmiVersion]
        self.fmu = of_version(self.model, directory, log)
        self.slave = self.fmu.slave
        self.time = 0.0

    def set(self, values):
        for name, value in values.items():
            self.fmu.set([self.references[name]], [float(value)])

    def get(self, *names):
        return self.fmu.get([self.references[name] for name in names])

    def start(self, values):
        self.set(values)
        self.fmu.start()

    def step(self, h):
        self.slave.doStep(self.time, h)
        self.time += h


@contextmanager
def twin(fmu, log=None):
    directory = fmpy.extract(fmu)
    one = Twin(fmu, directory, log)
    try:
        yield one
        one.slave.terminate()
    finally:
        one.slave.freeInstance()
        shutil.rmtree(directory)


def largest_difference(rows, others):
    assert len(rows) == len(others) > 10, (len(rows), len(others))
    return max(abs(a - b) for row, other in zip(rows, others) for a, b in zip(row, other))


def validate(version):
    fmu = export(f"chapter-{version}.fmu", "--fmi", version)
    problems = validate_fmu(fmu)
    assert not problems, problems
    model = fmpy.read_model_description(fmu)
    assert model.fmiVersion == version
    variables = {v.name: v for v in model.modelVariables}
    assert variables["cmd_qx"].unit == "rad" and variables["x"].unit == "m"
    assert float(variables["x_servo.lag"].start) == 0.06
    kinds = {kind: [v.name for v in model.modelVariables if v.variability == kind] for kind in ["fixed", "tunable"]}
    assert kinds["fixed"] == ["ball_radius", "inertia_factor", "plate_thickness", "longest_step"]
    assert len(kinds["tunable"]) == 17 and "x_servo.command_gain" in kinds["tunable"]
    result = fmpy.simulate_fmu(fmu, stop_time=1, start_values={"cmd_qy": 0.1})
    assert len(result) == 101 and result["x"][-1] > 0.3
    return fmu


def held_plates(fmu):
    """The same commands and the same step as a scene whose plate stands still."""
    (DATA / "rig.json").write_text(
        json.dumps(
            {
                "name": "hollow",
                "ball": {"radius_m": 0.02, "mass_kg": 0.0027, "inertia_factor": 0.6666},
                "plate": {"length_m": 0.3, "width_m": 0.3, "thickness_m": 0.004},
            }
        )
    )
    hollow = json.loads((DATA / "rig.json").read_text())
    of_rig = export("rig.fmu", "--asset", "rig.json")
    cases = [
        ("slope", fmu, pi / 20, pi / 20, [0, 0, 0, 0], {}),
        ("thrown", fmu, -0.11, 0.07, [0.05, -0.03, -0.4, 0.2], {}),
        ("hollow", of_rig, 0.2, -0.15, [0, 0.01, 0.1, 0], {key: hollow[key] for key in ["ball", "plate"]}),
    ]
    for name, model, qx, qy, ball, content in cases:
        height = 0.0227 if not content else 0.022
        wanted = scene(
            name,
            0.01,
            *["--method", "rk4", "--step", 0.01],
            duration_s=2,
            qx=[{"constant_rad": qx}],
            qy=[{"constant_rad": qy}],
            initial={"position_m": [*ball[:2], height], "velocity_m_s": [*ball[2:], 0]},
            **content,
        )
        with twin(model) as one:
            start = dict(zip(BALL, ball)) | {"cmd_qx": qx, "cmd_qy": qy, "longest_step": 0.01}
            one.start({**IDEAL, **start})
            rows = [one.get(*BALL)]
            for _ in range(200):
                one.step(0.01)
                rows.append(one.get(*BALL))
            assert one.get("qx", "qy") == [qx, qy]
        difference = largest_difference(rows, wanted)
        print(f"{name}: the FMU and the scene differ by at most {difference:.1e} m, m/s")
        assert difference < 1e-12, difference


def write_session(name, rows):
    header = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n"
    text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    (DATA / f"{name}.csv").write_text(header + text)


def with_fmpy(fmu, session, longest_step):
    """Returns ball and plate of the FMU under the commands of the session, for each sample."""
    (_, qx, qy, x, y), *_ = session
    with twin(fmu) as one:
        one.start({"cmd_qx": qx, "cmd_qy": qy, "x": x, "y": y, "longest_step": longest_step})
        rows = [one.get(*BALL_AND_PLATE)]
        for (t, qx, qy, *_), (end, *_) in zip(session, session[1:]):
            one.set({"cmd_qx": qx, "cmd_qy": qy})
            one.step(end - t)
            rows.append(one.get(*BALL_AND_PLATE))
    return rows


def fmpy_rows(fmu, start, commands, h, faults={}):
    """Runs the FMU in FMPy; returns ball and plate after each of the commands. `faults` has values
    that are set before the step with this number.
    """
    rows = []
    with twin(fmu) as one:
        one.start(start)
        for i, (qx, qy) in enumerate(commands):
            one.set({"cmd_qx": qx, "cmd_qy": qy, **faults.get(i, {})})
            one.step(h)
            rows.append(one.get(*BALL_AND_PLATE))
    return rows


def ecos_rows(fmu, start, commands, h, faults={}):
    """The same as `fmpy_rows`, in ecos."""
    rows = []
    with ecospy.EcosSimulationStructure() as structure:
        structure.add_model("twin", str(fmu))
        named = {f"twin::{name}": value for name, value in start.items()}
        structure.add_parameter_set("start", named)
        with ecospy.EcosSimulation(structure=structure, step_size=h) as simulation:
            simulation.init(parameter_set="start")
            for i, (qx, qy) in enumerate(commands):
                for name, value in {"cmd_qx": qx, "cmd_qy": qy, **faults.get(i, {})}.items():
                    simulation.set_real(f"twin::{name}", value)
                simulation.step()
                rows.append([simulation.get_real(f"twin::{name}") for name in BALL_AND_PLATE])
            simulation.terminate()
    return rows


def libcosim_rows(fmu, start, commands, h, faults={}):
    """The same as `fmpy_rows`, in libcosim, which counts the time in nanoseconds."""
    rows = []
    model = fmpy.read_model_description(fmu)
    references = {v.name: v.valueReference for v in model.modelVariables}
    execution = CosimExecution.from_step_size(round(h * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name="twin"))
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    assert execution.add_observer(observer) and execution.add_manipulator(manipulator)
    for name, value in start.items():
        assert execution.real_initial_value(slave, references[name], value)
    for i, (qx, qy) in enumerate(commands):
        values = {"cmd_qx": qx, "cmd_qy": qy, **faults.get(i, {})}
        named = [references[name] for name in values]
        assert manipulator.slave_real_values(slave, named, list(values.values()))
        assert execution.step(), i
        rows.append(observer.last_real_values(slave, [references[name] for name in BALL_AND_PLATE]))
    return rows


# Each importer with the versions that it reads.
IMPORTERS = {
    "FMPy": (fmpy_rows, ["2.0", "3.0"]),
    "ecos": (ecos_rows, ["2.0", "3.0"]),
    "libcosim": (libcosim_rows, ["2.0"]),
}
log_output_level(CosimLogLevel.ERROR)


def in_importers(fmus, *run):
    """Returns the name of each importer and version, and the rows that it sees."""
    return [
        (f"{name}, FMI {version}", rows(fmus[version], *run))
        for name, (rows, versions) in IMPORTERS.items()
        for version in versions
    ]


def moving_plate():
    """The same commands as in a free run of the same rig: its servos have dead time, lag and
    limits, of which the commands reach that of the angle.
    """
    # No multiple of a step: a servo would begin to turn at the end of one step or the start of the
    # next, as the importer's times are rounded, and the ball would see it in that step.
    servo = {"angle_limit_rad": 0.2, "dead_time_s": 0.0437, "lag_s": 0.06, "rate_limit_rad_s": 10}
    (DATA / "moving.json").write_text(json.dumps({"name": "moving", "servo": servo}))
    fmus = {v: export(f"moving-{v}.fmu", "--asset", "moving.json", "--fmi", v) for v in VERSIONS}
    cases = [(0.02, 0.005), (0.01, 0.01), (0.008, 0.008), (0.004, 0.004), (0.002, 0.002)]
    for h, longest_step in cases:

        def sample(i):
            t = i * h
            return t, 0.12 * sin(3 * t), 0.25 * sin(4.4 * t + 1), 0.03, -0.02

        session = [sample(i) for i in range(round(4 / h))]
        write_session("swing", session)
        wanted = free_run("swing", longest_step, "moving.json")
        assert max(row[5] for row in wanted) == 0.2 and min(row[5] for row in wanted) < -0.19
        _, *wanted = wanted
        start = {"cmd_qx": session[0][1], "cmd_qy": session[0][2], "x": 0.03, "y": -0.02}
        start["longest_step"] = longest_step
        commands = [(qx, qy) for _, qx, qy, *_ in session[:-1]]
        for name, rows in in_importers(fmus, start, commands, h):
            difference = largest_difference(rows, wanted)
            print(f"swing, steps of {h} s: {name} and the scene differ by at most {difference:.1e}")
            assert difference < 1e-12, difference


def scaled_commands():
    """A servo whose gain changes in mid-run moves as one that gets commands of another size: in
    the scene, from a dead time earlier on. Every time is a multiple of 2⁻⁷ s, which no importer
    rounds, so that all of them must see the same to the bit.
    """
    h, late, at = 2**-7, 5, 200
    servo = {"angle_limit_rad": 0.2, "dead_time_s": late * h, "lag_s": 0.06, "rate_limit_rad_s": 10}
    (DATA / "scaled.json").write_text(json.dumps({"name": "scaled", "servo": servo}))
    fmus = {v: export(f"scaled-{v}.fmu", "--asset", "scaled.json", "--fmi", v) for v in VERSIONS}
    commands = [(0.1 * sin(3 * i * h), 0.15 * sin(4.4 * i * h)) for i in range(401)]
    faulty = [(0.4 * qx, -qy) if i >= at - late else (qx, qy) for i, (qx, qy) in enumerate(commands)]
    write_session("scaled", [(i * h, *command, 0.0, 0.0) for i, command in enumerate(faulty)])
    _, *wanted = free_run("scaled", h, "scaled.json")
    run = [{"longest_step": h}, commands[:-1], h]
    gains = {"y_servo.command_gain": 0.4, "x_servo.command_gain": -1}
    (_, first), *others = in_importers(fmus, *run, {at: gains})
    difference = largest_difference(first, wanted)
    print(f"other gains: the FMU and the scene differ by at most {difference:.1e}")
    assert difference < 1e-12, difference
    assert largest_difference(fmpy_rows(fmus["3.0"], *run), wanted) > 0.1
    for name, rows in others:
        assert rows == first, (name, largest_difference(rows, first))
        print(f"{name}: {len(rows)} steps with a fault as in FMPy, FMI 2.0, to the bit")


def injected_faults():
    """The faults that `offbd simulate` injects: the FMU, with the same commands and the same fault,
    follows the curvature of the simulated path, and without the fault it does not. A straight line
    is taken away, because the FMU starts with another motion.
    """
    at, end = 6.0, 7.5
    ideal = ["--rig", "simulated.json", "--reference", "circle", "--quantum-m", 1e-6]
    for name in ["--noise-m", "--dead-band-m", "--breakaway-deg", "--level-deg", "--outliers", "--missing"]:
        ideal += [name, 0]
    faults = {
        "gain=0.4": {"command_gain": 0.4},
        "reversed": {"command_gain": -1},
        "dead": {"command_gain": 0},
        "hold": {"rate_limit": 1e-6},
        "offset=0.05": {"level": 0.05},
        "slow=12": {"lag": 12 * 0.06, "rate_limit": 10 / 12},
    }
    for fault, values in faults.items():
        offbd("simulate", "--seconds", 9, *ideal, "--fault", f"x_servo:{fault}@{at}", "-o", "faulty.csv")
        fmu = export("simulated.fmu", "--asset", "simulated.json")
        names = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m"]
        rows = columns(DATA / "faulty.csv", *names)
        named = {f"x_servo.{name}": value for name, value in values.items()}
        with_fault, without = (unlike(fmu, rows, at, end, values) for values in [named, {}])
        print(f"{fault}: x differs by {with_fault:.1e} m rms with the fault, {without:.1e} m without")
        assert with_fault < 0.15 * without, (fault, with_fault, without)


def unlike(fmu, rows, at, end, fault):
    """Returns the root of the mean square of simulated path minus that of the FMU with the fault,
    less a line, from `at` to `end`.
    """
    times, differences = [], []
    with twin(fmu) as one:
        one.time = rows[0][0]
        one.start({"cmd_qx": rows[0][1], "cmd_qy": rows[0][2]})
        for (t, qx, qy, _), (to, _, _, x) in zip(rows, rows[1:]):
            one.set({"cmd_qx": qx, "cmd_qy": qy, **(fault if t >= at else {})})
            one.step(to - one.time)
            if x is not None and abs(x) > BEFORE_THE_RIM:
                break
            if at <= to <= end and x is not None:
                times.append(to)
                differences.append(x - one.get("x")[0])
    line = np.polynomial.Polynomial.fit(times, differences, 1)
    return float(np.sqrt(np.mean((np.array(differences) - line(np.array(times))) ** 2)))


def recorded_session():
    """A calibrated rig, whose axes differ, and commands that were recorded at uneven intervals."""
    long = ["--reference", "lissajous", "--seconds", 90, "--seed", 7]
    offbd("simulate", "--rig", "of-owner.json", *long, "-o", "healthy.csv")
    offbd("calibrate", "--asset", "of-owner.json", "healthy.csv", "-o", "calibrated.json")
    offbd("simulate", "--seconds", 10, "--seed", 3, "-o", "recorded.csv")
    # A row may lack the position, and the twin starts at the first one.
    names = ["t_s", "cmd_qx_rad", "cmd_qy_rad"]
    session = [[*row, 0.01, 0.02] for row in columns(DATA / "recorded.csv", *names)]
    assert len({round(b[0] - a[0], 6) for a, b in zip(session, session[1:])}) > 1
    write_session("recorded", session)
    fmu = export("learnt.fmu", "--asset", "calibrated.json")
    wanted = free_run("recorded", 0.002, "calibrated.json")
    difference = largest_difference(with_fmpy(fmu, session, 0.002), wanted)
    print(f"recorded: the FMU and the scene differ by at most {difference:.1e}")
    assert difference < 1e-12, difference


def smooth_plate(fmu):
    """A plate that turns to an angle and back, qx after qy, smoothly in the scene. The servos have
    a lag; the commands are those by which it turns as in the scene, held for a step each, so that
    the FMU approaches the scene with the step.
    """
    lag = 0.06
    laws = {"cmd_qx": [(0.08, 0.3, 0.6), (-0.16, 1.1, 0.5)], "cmd_qy": [(0.1, 0, 0.5), (-0.2, 0.6, 0.7)]}

    def command(law, t):
        """The angle of the law, and the lag times its rate."""
        total = 0
        for to, start, duration in law:
            s = min(max((t - start) / duration, 0), 1)
            total += to * (3 * s**2 - 2 * s**3) + lag * to / duration * 6 * (s - s**2)
        return total

    def of_scene(law):
        names = ["to_rad", "start_s", "duration_s"]
        return [{"smoothstep": dict(zip(names, term))} for term in law]

    wanted = scene(
        "smooth",
        0.04,
        *["--method", "dopri5", "--tolerance", 1e-11],
        duration_s=2,
        qx=of_scene(laws["cmd_qx"]),
        qy=of_scene(laws["cmd_qy"]),
    )

    def run(h):
        per_row = round(0.04 / h)
        lags = {"x_servo.lag": lag, "y_servo.lag": lag, "longest_step": h}
        with twin(fmu) as one:
            one.start({**IDEAL, **lags})
            rows = [one.get(*BALL)]
            for i in range(50 * per_row):
                one.set({name: command(law, (i + 0.5) * h) for name, law in laws.items()})
                one.step(h)
                if (i + 1) % per_row == 0:
                    rows.append(one.get(*BALL))
        return largest_difference(rows, wanted)

    differences = [run(h) for h in [8e-3, 4e-3, 2e-3]]
    print("smooth: the FMU and the scene differ by", *[f"{d:.1e}" for d in differences], "m, m/s")
    for longer, shorter in zip(differences, differences[1:]):
        assert shorter < 0.6 * longer, differences


def saved_states(fmu):
    with twin(fmu) as one:
        one.start({"cmd_qy": 0.1})

        def ten_steps():
            for i in range(10):
                one.set({"cmd_qx": 0.1 * sin(i)})
                one.step(0.01)
            return one.get(*BALL_AND_PLATE)

        ten_steps()
        time, state = one.time, one.fmu.save()
        saved = one.fmu.to_bytes(state)
        first = ten_steps()
        one.time = time
        one.fmu.restore(state)
        assert ten_steps() == first
        one.fmu.free(state)
        again = one.fmu.of_bytes(saved)
        one.time = time
        one.fmu.restore(again)
        assert ten_steps() == first
        one.fmu.free(again)
        one.slave.reset()
        one.time = 0.0
        one.start({"ball_radius": 0.02})
        assert one.get("x", "ball_radius") == [0.0, 0.02]


def refusals(fmu):
    messages = []
    with twin(fmu, messages.append) as one:
        one.start({})
        for call, expected in [
            (lambda: one.set({"ball_radius": 0.02}), "ball_radius cannot be set after"),
            (lambda: one.set({"cmd_qx": 1e9}), "cmd_qx: 1000000000 is outside -1000 to 1000"),
            (lambda: one.slave.doStep(5.0, 0.01), "the step begins at 5 s"),
            (lambda: one.fmu.get_integer([0]), f"{one.fmu.not_offered} is not offered"),
        ]:
            try:
                call()
            except Exception as error:
                assert "Error" in str(error) or "status 3" in str(error), error
            else:
                raise AssertionError(f"not refused: {expected}")
            assert expected in messages[-1], messages


def refused_exports():
    (DATA / "no.so").write_text("#!/bin/sh\n")
    reason = offbd("export", "fmu", "--library", "no.so", "-o", "no.fmu", status=3).stderr
    assert "no.so: is not a shared library" in reason, reason
    assert not (DATA / "no.fmu").exists()
    twice = ["--library", LIBRARY] * 2
    reason = offbd("export", "fmu", *twice, "-o", "no.fmu", status=3).stderr
    assert "two libraries for x86_64-linux" in reason, reason
    program = DATA / "alone"
    shutil.copy(PROGRAM, program)
    run = subprocess.run([program, "export", "fmu", "-o", "no.fmu"], capture_output=True, text=True, cwd=DATA)
    assert run.returncode == 3 and "--package offbd-fmu" in run.stderr, run.stderr


if __name__ == "__main__":
    FMUS = {version: validate(version) for version in VERSIONS}
    for FMU in FMUS.values():
        held_plates(FMU)
        smooth_plate(FMU)
        saved_states(FMU)
        refusals(FMU)
    moving_plate()
    scaled_commands()
    injected_faults()
    recorded_session()
    refused_exports()
