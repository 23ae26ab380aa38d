"""The documents of offbd, as in openapi.yaml. generate_documents.py writes this file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict

if TYPE_CHECKING:
    # Python 3.10 has it in no module of its library, and needs it only to check types.
    from typing_extensions import NotRequired


class Act(TypedDict):
    """
    An action of a person.
    """

    at: str
    """
    Time of the action, RFC 3339.
    """
    by: str
    """
    Name of the principal, or the request's `by` if the service requires no token.
    """


AlarmCode: TypeAlias = Literal["x_servo", "y_servo", "stuck_ball", "sensor", "communication_lost"]
"""
What an alarm is about: a fault code, or that no data of the rig arrive.
"""


class Answer(TypedDict):
    """
    A servo's recent parameters, relative to the twin, with standard errors.
    """

    delay_error_s: float
    """
    Standard error of the delay, s.
    """
    delay_s: float
    """
    Delay in addition to the twin's, s.
    """
    gain: float
    """
    Gain relative to the twin: 1 is healthy.
    """
    gain_error: float
    """
    Standard error of the gain.
    """
    likelihoods: list[float]
    """
    Normalised likelihoods of the kinds dead, held, reversed, gain, offset and slow, in
    this order; they sum to one.
    """
    offset_error_m_s2: float
    """
    Standard error of the offset, m/s².
    """
    offset_m_s2: float
    """
    Acceleration that the command does not explain, m/s².
    """


class Axes(TypedDict):
    """
    Axes, signs, units and origin of the device's numbers, relative to the plate frame.
    """

    command_unit_rad: NotRequired[float]
    """
    Radians per unit of the commands: 0.01745 for degrees.
    """
    position_unit_m: NotRequired[float]
    """
    Metres per unit of the positions: 0.001 for millimetres.
    """
    swap: NotRequired[bool]
    """
    Whether the device's x is the plate's y, and its y the plate's x.
    """
    x_offset_m: NotRequired[float]
    """
    Reading along the plate's x in the middle of the plate (or of the range that end
    stops leave), after sign and unit, in [−10, 10] m.
    """
    x_sign: NotRequired[float]
    """
    Sign of the readings along the plate's x, 1 or −1.
    """
    y_offset_m: NotRequired[float]
    """
    Reading along the plate's y in the middle of the plate (or of the range that end
    stops leave), after sign and unit, in [−10, 10] m.
    """
    y_sign: NotRequired[float]
    """
    Sign of the readings along the plate's y, 1 or −1.
    """


Axis: TypeAlias = Literal["x", "y"]
"""
A direction of ball motion.
"""


class AxisCalibration(TypedDict):
    """
    Learnt parameters of one axis.
    """

    breakaway_rad: float
    """
    Tilt below which a ball at rest stays at rest, in [0, 1] rad.
    """
    dead_time_s: float
    """
    Time from a command to the servo's first movement, in [0, 5] s.
    """
    familiar_m_s2: NotRequired[float | None]
    """
    Acceleration up to which gain and delay were learnt, in [0, 1000] m/s²; absent if
    unknown.
    """
    gain: float
    """
    Measured over modelled acceleration, in [−100, 100].
    """
    gain_spread: NotRequired[float]
    """
    Standard deviation of the gain from session to session, as a fraction of the gain, in
    [0, 10].
    """
    lag_s: float
    """
    Time constant of the servo's first-order lag, in [0, 10] s.
    """
    level_rad: float
    """
    Angle by which plate or servo horn is off level, the mean over sessions, in
    [−1, 1] rad.
    """
    level_spread_rad: NotRequired[float]
    """
    Standard deviation of the level from session to session, in [0, 1] rad.
    """
    longest_repeat_s: NotRequired[float]
    """
    Longest time for which healthy readings were bit-identical, in [0, 60] s.
    """
    model_error_m_s2: NotRequired[float | None]
    """
    Acceleration that the twin does not explain, over half a second, in (0, 100] m/s²;
    if absent, it is assumed from the residual.
    """
    most_nats: NotRequired[float]
    """
    Largest evidence against the servo while it was healthy, in [0, 1000] nats.
    """
    most_path_nats: NotRequired[float | None]
    """
    Largest evidence of the path against the servo while it was healthy, in [0, 1000]
    nats. If absent, it is unknown, and the path alone does not accuse the servo: calibrate
    the rig again.
    """
    noise_m: float
    """
    Standard deviation of the readings about the fitted motion, in (0, 1] m.
    """
    residual_m_s2: float
    """
    Robust standard deviation of the acceleration residual, in (0, 100] m/s².
    """
    resistance_m_s2: NotRequired[float]
    """
    Deceleration of a rolling ball, in [0, 10] m/s²; 0 if it was not learnt.
    """
    rest_s: NotRequired[float]
    """
    Longest time for which the ball was seen at rest, in [0, 1e9] s; if 0, the breakaway
    angle is unknown.
    """


class AxisEvidence(TypedDict):
    """
    The quantities of one axis at one time. A quantity that is unknown is null.
    """

    answer: NotRequired[Answer | None]
    command_rad: NotRequired[float | None]
    """
    Command of the plate angle that moves the ball along this axis, rad.
    """
    enabled: bool
    """
    Whether the enable condition holds: the residual may be judged.
    """
    identical_s: NotRequired[float]
    """
    Time for which the readings along this axis have been bit-identical, s.
    """
    limit_m_s2: float
    """
    Limit of the residual, m/s².
    """
    measured_m_s2: NotRequired[float | None]
    """
    Measured acceleration over the window, m/s².
    """
    nats: NotRequired[float]
    """
    Evidence for a fault of the servo: natural logarithm of the likelihood ratio of a
    broken and a healthy servo, nats.
    """
    path_limit_nats: NotRequired[float | None]
    """
    Evidence of the path from which on the servo fails, nats; null if unknown.
    """
    path_nats: NotRequired[float | None]
    """
    Evidence of the path of the last seconds for a fault of the servo, nats, in which the
    scale of the twin's error is the session's own; negative if the path speaks for a
    healthy servo, null if it cannot be tested.
    """
    position_m: NotRequired[float | None]
    """
    Measured position, from the fit over the window, m.
    """
    residual_m_s2: NotRequired[float | None]
    """
    Residual: measured minus the twin's acceleration, m/s².
    """
    twin_m_s2: NotRequired[float | None]
    """
    The twin's acceleration through the same filter, m/s².
    """
    velocity_m_s: NotRequired[float | None]
    """
    Measured velocity, from the fit over the window, m/s.
    """


class Ball(TypedDict):
    """
    The ball.
    """

    inertia_factor: NotRequired[float]
    """
    κ in the moment of inertia κ m r², in [0, 1]: 0.4 for a solid ball, 0.667 for a
    hollow one.
    """
    mass_kg: NotRequired[float]
    """
    Mass, in [1e-6, 100] kg.
    """
    radius_m: NotRequired[float]
    """
    Radius, in (0, 1] m.
    """


class Contact(TypedDict):
    """
    The contact between a body and the plate: spring, damper and friction.
    """

    damping_n_s_per_m: NotRequired[float]
    """
    Damping D, in (0, 1e9] N·s/m.
    """
    friction: NotRequired[float]
    """
    Coefficient of friction μ, in (0, 100].
    """
    slip_threshold_m_s: NotRequired[float]
    """
    Slip speed at and above which friction acts in full, in (0, 10] m/s.
    """
    stiffness_n_per_m: NotRequired[float]
    """
    Stiffness K, in (0, 1e12] N/m.
    """


EvidenceState: TypeAlias = Literal["complete", "partial", "none"]
"""
How much of the evidence of an occurrence is kept.
"""


FaultCode: TypeAlias = Literal["x_servo", "y_servo", "stuck_ball", "sensor"]
"""
Fault code: the part of the rig that has the fault.
"""


FaultKind: TypeAlias = Literal[
    "dead",
    "held",
    "gain",
    "reversed",
    "offset",
    "slow",
    "intermittent",
    "frozen",
    "dropout",
    "noise",
    "spikes",
    "jump",
]
"""
Kind of a fault: the failure mode.
"""


FaultStatus: TypeAlias = Literal["pending", "confirmed", "healed", "cleared"]
"""
Status of a fault code, a summary of its ISO 14229 status byte.
"""


class FleetFault(TypedDict):
    """
    Summary of an active fault.
    """

    acknowledged: bool
    """
    Whether the current occurrence has been acknowledged.
    """
    changed_at: str
    """
    Time at which the record last changed, RFC 3339.
    """
    code: FaultCode
    failed_at: NotRequired[str | None]
    """
    Time at which the service judged the sample at which the test last began to fail,
    RFC 3339; null if unknown.
    """
    failing: bool
    """
    Whether the last result of its test is a failure; false for a fault on record whose
    test passes again.
    """
    kind: NotRequired[FaultKind | None]
    kind_weight: NotRequired[float | None]
    """
    Weight of this kind among the candidates, in (0, 1]; null without a kind.
    """
    status: FaultStatus
    """
    `pending` or `confirmed`.
    """
    tested: bool
    """
    Whether this result is one of the last session that was opened; false if the test has had
    none in it yet.
    """


HistoryEvent: TypeAlias = Literal[
    "pending", "confirmed", "healed", "cleared", "acknowledge", "clear"
]
"""
An entry of the history of a fault code: the status it changed to, or the action of a
person.
"""


class InUse(TypedDict):
    """
    How often a monitor was able to find its fault: the in-use performance of SAE J1979.
    Counted at the end of each session; neither clearing nor aging erases it.
    """

    cycles_judged: int
    """
    Operation cycles in which the monitor was enabled for long enough to find a fault.
    """
    cycles_with_data: int
    """
    Operation cycles with enough data to judge.
    """
    operation_cycles: int
    """
    Operation cycles (sessions) that have ended.
    """
    ratio: NotRequired[float | None]
    """
    `cycles_judged` divided by `cycles_with_data`, 0 to 1; null if `cycles_with_data` is
    0. A low ratio means that the enable condition is too strict for this rig.
    """


JobState: TypeAlias = Literal["queued", "running", "done", "failed"]
"""
State of a background job.
"""


JobWaitReason: TypeAlias = Literal["jobs", "samples"]
"""
Why a background job waits.
"""


LearningState: TypeAlias = Literal["gathering", "learning", "offered", "learnt"]
"""
State of a rig's automatic calibration.
"""


LeftOutReason: TypeAlias = Literal["jumped", "held", "stood"]
"""
Why a moment contradicts the rest of the sessions.
"""


LineType: TypeAlias = Literal["fault", "summary"]
"""
The kind of a line of a verdict.
"""


Misfit: TypeAlias = Literal[
    "no_readings",
    "no_commands",
    "no_axis",
    "short",
    "rate",
    "positions",
    "commands",
    "commands_held",
    "one_axis",
    "swapped",
    "wrong_sign",
    "scale",
    "no_room",
    "level",
]
"""
A contradiction between data and asset file.
"""


class MonitorCertificate(TypedDict):
    """
    Test result of one monitor on healthy recordings that the calibration did not learn
    from, and the false alarms to expect on the healthy rig.
    """

    alarms_per_hour: NotRequired[float | None]
    """
    Expected false alarms per hour of operation, in [0, 1e6]: the mean over rigs like this
    one; null if the monitor could not judge.
    """
    code: FaultCode
    """
    Fault code of the monitor.
    """
    judged_s: float
    """
    Time of the recordings for which the monitor could judge, s, in [0, 1e9].
    """
    most_alarms_per_hour: NotRequired[float | None]
    """
    False alarms per hour that nine of ten such rigs stay below, in [0, 1e6]; null if
    unknown, as in calibrations of earlier versions.
    """
    nearest: float
    """
    Closest approach to an alarm, in [0, 1]: 1 would confirm a fault.
    """


class Mute(TypedDict):
    """
    A mute of a monitor: it is not tested, as far as people are told. The monitor goes on, and
    the fault memory records what it finds.
    """

    asset: str
    at: str
    """
    Time at which it was muted, RFC 3339.
    """
    by: str
    """
    Who has muted it: name of the principal, or the request's `by` if the service requires
    no token.
    """
    code: AlarmCode
    etag: str
    """
    Entity tag of the mute, for `If-Match`.
    """
    reason: str
    until: str
    """
    Time at which the mute ends by itself, RFC 3339.
    """


class NamedKind(TypedDict):
    """
    A failure mode that a confirmed fault was given.
    """

    kind: FaultKind
    t_s: float
    """
    Time at which it was first named, s on the device's clock.
    """
    weight: NotRequired[float | None]
    """
    Its weight among the candidates, in (0, 1]: of the last kind as in the fault's record, of
    an earlier one the largest; null if unknown.
    """


class Occurrence(TypedDict):
    """
    An occurrence of a fault.
    """

    calibration_id: NotRequired[str | None]
    """
    Id of the calibration that was used; null if the rig was not calibrated.
    """
    noted_at: str
    """
    Time at which the service judged the sample at which the test failed, RFC 3339.
    """
    session: str
    """
    The session's name.
    """
    session_id: str
    """
    The service's id of the session, which may have been deleted since.
    """
    settings_id: str
    """
    Id of the profile, settings and rig description that were used.
    """


Outcome: TypeAlias = Literal[
    "fault", "cannot tell", "pending", "no fault", "partly judged", "not learnt", "not judged"
]
"""
The result of a session, or of one monitor in a session.
"""


PlantModel: TypeAlias = Literal["planar", "rolling", "sliding"]
"""
A plant model of the twin, in the order of computing cost.
"""


class Plate(TypedDict):
    """
    The plate: `length_m` and `width_m`, or `diameter_m` for a round one.
    """

    diameter_m: NotRequired[float | None]
    """
    Diameter of a round plate, in (0, 10] m; excludes length and width.
    """
    length_m: NotRequired[float | None]
    """
    Length along x, in (0, 10] m; 0.38 if neither it nor a diameter is given.
    """
    rim: NotRequired[bool]
    """
    Whether a rim stops the ball at the edge.
    """
    thickness_m: NotRequired[float]
    """
    Thickness, in [0, 1] m.
    """
    width_m: NotRequired[float | None]
    """
    Width along y, in (0, 10] m; 0.24 if neither it nor a diameter is given.
    """


PlateAngle: TypeAlias = Literal["qx", "qy"]
"""
The plate angle that a servo turns: `qy` moves the ball along x, `qx` along y.
"""


Profile: TypeAlias = Literal["default", "textbook"]
"""
Named set of settings of the diagnosis: `default` for real rigs, `textbook` for the
rule of the book.
"""


class Provenance(TypedDict):
    """
    Where and when the fault occurred, and who acknowledged or cleared it.
    """

    acknowledgement: NotRequired[Act | None]
    cleared: NotRequired[Act | None]
    first_occurrence: NotRequired[Occurrence | None]
    last_occurrence: NotRequired[Occurrence | None]


class ReplaySettings(TypedDict):
    """
    Settings with which a session is judged again.
    """

    asset: NotRequired[Any]
    """
    Changes to the asset file that was in use when the session was opened, as a JSON merge
    patch (RFC 7396).
    """
    calibration: NotRequired[str | None]
    """
    Id of a calibration of the asset, or of the job that made it, to use instead of the
    calibration that was in use when the session was opened.
    """
    debounce_s: NotRequired[float | None]
    """
    Debounce time of all monitors: how long a failure must last before the test fails, in
    [0, 60] s.
    """
    false_alarms_per_rig_year: NotRequired[float | None]
    """
    Accepted false alarms per rig and year, above 0.
    """
    profile: NotRequired[Profile | None]


class Row(TypedDict):
    """
    A row that was rejected or not judged, with the reason.
    """

    index: int
    """
    Index of the row in the batch, from 0.
    """
    reason: str
    """
    Why it was rejected or not judged.
    """


class Sample(TypedDict):
    """
    One sample. A value that the device does not have is null.
    """

    cmd_qx_rad: NotRequired[float | None]
    """
    Command of the plate angle about x, in the device's unit, sign and axes.
    """
    cmd_qy_rad: NotRequired[float | None]
    """
    Command of the plate angle about y, in the device's unit, sign and axes.
    """
    seq: NotRequired[int | None]
    """
    Number of the sample within the session, by which a duplicate is recognised; absent
    if the device does not number its samples, and then `t_s` is used.
    """
    t_s: float
    """
    Time, s on the device's clock.
    """
    x_m: NotRequired[float | None]
    """
    Position of the ball along x, in the device's unit, sign and axes.
    """
    y_m: NotRequired[float | None]
    """
    Position of the ball along y, in the device's unit, sign and axes.
    """


class SensorCalibration(TypedDict):
    """
    Learnt properties of the sensor.
    """

    longest_unseen_s: NotRequired[float]
    """
    Longest time for which no ball was seen on the plate, in [0, 60] s.
    """
    most_outliers: NotRequired[float]
    """
    Largest number of recent outliers, each fading with a time constant of ten seconds,
    in [0, 1e6].
    """
    most_scatter_m: NotRequired[float]
    """
    Largest scatter about the motion that persisted, in [0, 1] m; 0 if unknown.
    """
    refresh_s: NotRequired[float]
    """
    Time between two readings of a sensor that is slower than its log, in [0, 10] s; 0
    for one that is not.
    """


SeriesAggregate: TypeAlias = Literal["mean", "min", "max", "last"]
"""
How the values of several sessions become one.
"""


class SeriesValues(TypedDict):
    """
    The values of a row; each is null if no session has it.
    """

    delay_x_s: NotRequired[float | None]
    """
    Delay of the x servo in addition to the twin's, s.
    """
    delay_y_s: NotRequired[float | None]
    """
    Delay of the y servo in addition to the twin's, s.
    """
    gain_x: NotRequired[float | None]
    """
    Gain of the x servo relative to the calibration: 1 means unchanged.
    """
    gain_y: NotRequired[float | None]
    """
    Gain of the y servo relative to the calibration: 1 means unchanged.
    """
    judged_sensor: NotRequired[float | None]
    """
    Share of the session in which the sensor could be judged, 0 to 1.
    """
    judged_stuck_ball: NotRequired[float | None]
    """
    Share of the session in which it could be judged whether the ball is stuck, 0 to 1.
    """
    judged_x_servo: NotRequired[float | None]
    """
    Share of the session in which the x servo could be judged, 0 to 1.
    """
    judged_y_servo: NotRequired[float | None]
    """
    Share of the session in which the y servo could be judged, 0 to 1.
    """
    offset_x_m_s2: NotRequired[float | None]
    """
    Acceleration along x that the command does not explain, m/s².
    """
    offset_y_m_s2: NotRequired[float | None]
    """
    Acceleration along y that the command does not explain, m/s².
    """
    residual_x_m_s2: NotRequired[float | None]
    """
    Root mean square along x of the acceleration that the twin does not predict, m/s².
    """
    residual_y_m_s2: NotRequired[float | None]
    """
    Root mean square along y of the acceleration that the twin does not predict, m/s².
    """


class Servo(TypedDict):
    """
    The servos; both have the same parameters.
    """

    angle_limit_rad: NotRequired[float]
    """
    Largest plate angle, in (0, π/2] rad.
    """
    dead_time_s: NotRequired[float]
    """
    Time from a command to the first movement, in [0, 5] s.
    """
    lag_s: NotRequired[float]
    """
    Time constant of the first-order lag, in [0, 10] s.
    """
    rate_limit_rad_s: NotRequired[float]
    """
    Largest angular rate, in (0, 1000] rad/s.
    """


ServoParameter: TypeAlias = Literal["gain", "offset", "delay"]
"""
A parameter of a servo that is tracked over sessions: gain, offset in m/s², delay in
s.
"""


class ServoProspects(TypedDict):
    """
    How soon faults of one servo would be confirmed, as in `ProspectsView`.
    """

    dead_s: NotRequired[float | None]
    """
    Median delay for a servo that does not respond, s.
    """
    half_gain_s: NotRequired[float | None]
    """
    Median delay for a servo with half its gain, s.
    """
    least_gain_loss: NotRequired[float | None]
    """
    Smallest tried loss of gain that is found, as a fraction of the gain; null if none is.
    """
    least_offset_rad: NotRequired[float | None]
    """
    Smallest tried slip of the horn that is found, rad; null if none is.
    """
    offset_1deg_s: NotRequired[float | None]
    """
    Median delay for a servo whose horn has slipped by 1°, s.
    """


class SessionEstimate(TypedDict):
    """
    Estimates of one session for one axis.
    """

    gain: NotRequired[float | None]
    """
    Measured over modelled acceleration; absent if the ball did not move.
    """
    gain_error: NotRequired[float | None]
    """
    Standard error of the gain; absent if the ball did not move.
    """
    level_error_rad: float
    """
    Standard error of the level, rad.
    """
    level_rad: float
    """
    Angle by which plate or servo horn is off level, rad.
    """


class SessionEstimates(TypedDict):
    """
    Estimates of one session.
    """

    x: NotRequired[SessionEstimate | None]
    y: NotRequired[SessionEstimate | None]


SessionState: TypeAlias = Literal["open", "ended"]
"""
State of a session: an ended one accepts no more samples.
"""


class StatusBits(TypedDict):
    """
    The ISO 14229 status byte, bit by bit from 0 to 7.
    """

    confirmed: bool
    """
    Bit 3: the fault is confirmed; set until the record ages or is cleared.
    """
    pending: bool
    """
    Bit 2: the test has failed in this session or in the last one that had a result.
    """
    test_failed: bool
    """
    Bit 0: the latest result of the test is a failure.
    """
    test_failed_since_last_clear: bool
    """
    Bit 5: the test has failed since the code was last cleared.
    """
    test_failed_this_operation_cycle: bool
    """
    Bit 1: the test has failed in this session.
    """
    test_not_completed_since_last_clear: bool
    """
    Bit 4: the test has had no result since the code was last cleared.
    """
    test_not_completed_this_operation_cycle: bool
    """
    Bit 6: the test has had no result in this session.
    """
    warning_indicator_requested: bool
    """
    Bit 7: a warning indicator is requested.
    """


class Step(TypedDict):
    """
    A jump of the readings that no ball can make.
    """

    size_m: float
    """
    Size of the jump, m.
    """
    t_s: float
    """
    Time of the first reading after the jump, s on the device's clock.
    """


class Stretch(TypedDict):
    """
    A stretch of a session.
    """

    from_s: float
    """
    First time on the device's clock, s.
    """
    session: str
    """
    Id of the session.
    """
    to_s: float
    """
    Last time on the device's clock, s.
    """


class Tally(TypedDict):
    """
    The number of transitions of each change.
    """

    altered: int
    moved: int
    only_recorded: int
    only_replayed: int
    same: int


class TeachingSession(TypedDict):
    """
    A session that a calibration uses.
    """

    id: str
    name: str
    """
    The device's name for the session, or the time at which it was opened.
    """


TrainingData: TypeAlias = str | Stretch
"""
Samples that a calibration learns from: a session by its id, or a stretch of one.
"""


TransitionChange: TypeAlias = Literal["same", "altered", "moved", "only_recorded", "only_replayed"]
"""
How a transition differs between two verdicts.
"""


class TrendWarning(TypedDict):
    """
    A warning that a servo drifts towards a fault.
    """

    axis: Axis
    code: FaultCode
    """
    Code of the expected fault.
    """
    command: PlateAngle
    limit: float
    """
    The limit that the value approaches.
    """
    parameter: ServoParameter
    sessions_left: NotRequired[float | None]
    """
    Number of sessions until the line reaches the limit at the present slope, at most 20;
    null if the value is far from the usual one without a significant slope.
    """
    summary: str
    """
    The warning in one sentence.
    """


class Unjudged(TypedDict):
    """
    Samples of a rig that are not judged, if they are at least 11 of the last 32.
    """

    reason: str
    """
    Why the last of them is not judged.
    """
    samples: int
    """
    Number of samples that have not been judged since they are so many.
    """


class Warning(TypedDict):
    """
    A contradiction between the data and the asset file.
    """

    code: Misfit
    message: str
    """
    The contradiction in one sentence, with its numbers.
    """


class Xy(TypedDict):
    """
    One value for each direction of ball motion.
    """

    x: float
    y: float


class AlarmEvidence(TypedDict):
    """
    What is kept of the last occurrence. A clear removes none of it: the values at each change
    stay in the history of the code, the recording stays in its session.
    """

    reason: NotRequired[str | None]
    """
    Why not everything is there; null if it is complete.
    """
    state: EvidenceState


class Candidate(TypedDict):
    """
    A possible cause and its weight.
    """

    code: FaultCode
    kind: NotRequired[FaultKind | None]
    weight: float
    """
    Weight in (0, 1]; the weights of all candidates sum to one. Two servos beside a stuck ball are
    one cause, both without power, and each has half of its weight.
    """


class Compared(TypedDict):
    """
    One transition in the recorded and the replayed verdict.
    """

    change: TransitionChange
    code: FaultCode
    kind: NotRequired[FaultKind | None]
    moved_s: NotRequired[float | None]
    """
    Replayed minus recorded time, s, positive if the replay is later; null if only one
    verdict has the transition.
    """
    recorded_t_s: NotRequired[float | None]
    """
    Time in the recorded verdict, s on the device's clock; null if only the replay has the
    transition.
    """
    replayed_t_s: NotRequired[float | None]
    """
    Time in the replayed verdict, s on the device's clock; null if only the record has the
    transition.
    """
    status: FaultStatus
    status_byte: str
    """
    ISO 14229 status byte, two hexadecimal digits.
    """


class Diagnostics(TypedDict):
    """
    Settings of the diagnosis.
    """

    debounce_s: NotRequired[float | None]
    """
    Debounce time of all monitors: how long a failure must last before the test fails, in
    [0, 60] s.
    """
    false_alarms_per_rig_year: NotRequired[float | None]
    """
    Accepted false alarms per rig and year, above 0.
    """
    profile: NotRequired[Profile | None]


class Evidence(TypedDict):
    """
    The quantities of the diagnosis at one time.
    """

    healthy_scatter_m: NotRequired[float]
    """
    Standard deviation of healthy readings, the larger of both axes, m: learnt, or assumed
    if the rig is not calibrated.
    """
    identical_s: float
    """
    Time for which the readings have been bit-identical, s.
    """
    jump: NotRequired[Step | None]
    missing_share: NotRequired[float]
    """
    Fraction of recent samples without a ball, 0 to 1.
    """
    outliers: int
    """
    Number of recent outliers, each fading with a time constant of ten seconds.
    """
    scatter_m: NotRequired[float | None]
    """
    Standard deviation of the readings about their fit, m; null if unknown.
    """
    still_s: float
    """
    Time for which the ball has stood still, s.
    """
    t_s: NotRequired[float | None]
    """
    Time of the judged sample, s on the device's clock; null without one.
    """
    unseen_s: float
    """
    Time for which no ball has been seen, s.
    """
    window_s: float
    """
    Length of the estimation window that was available, s.
    """
    x: AxisEvidence
    y: AxisEvidence


class Fault(TypedDict):
    """
    A transition: a change of a fault's status. If the kind of a fault is determined only
    after its confirmation, a further line with an unchanged status gives it.
    """

    axis: NotRequired[Axis | None]
    calibration_id: NotRequired[str | None]
    """
    Id of the calibration that was used; null if the rig was not calibrated.
    """
    candidates: list[Candidate]
    """
    Causes that would explain the evidence equally; empty if there is only one.
    """
    code: FaultCode
    command: NotRequired[PlateAngle | None]
    evidence: Evidence
    """
    The quantities at that time.
    """
    kind: NotRequired[FaultKind | None]
    onset_s: NotRequired[float | None]
    """
    Estimated time at which the deviation began, s on the device's clock; null if
    unknown.
    """
    session: str
    """
    The session's name.
    """
    settings_id: NotRequired[str]
    """
    Id of the profile, settings and rig description that were used.
    """
    status: FaultStatus
    status_byte: str
    """
    ISO 14229 status byte, two hexadecimal digits.
    """
    summary: str
    """
    The transition and its evidence in one sentence.
    """
    t_s: float
    """
    Time of the sample at which the status changed, s on the device's clock.
    """
    type: LineType
    """
    Always `fault`.
    """


class FaultEvent(Fault):
    """
    A transition in a session.
    """

    asset: str
    session_id: str
    """
    The service's id of the session.
    """


class FaultRecord(TypedDict):
    """
    The record of one fault code in the fault memory.
    """

    acknowledged: bool
    """
    Whether the current occurrence has been acknowledged.
    """
    aging_counter: int
    """
    Good operation cycles since healing, which count towards aging.
    """
    aging_cycles: int
    """
    Good operation cycles after healing at which the record is erased (aging).
    """
    axis: NotRequired[Axis | None]
    candidates: list[Candidate]
    """
    Causes that would explain the last failure equally; empty if there is only one.
    """
    code: FaultCode
    command: NotRequired[PlateAngle | None]
    failed_cycles: int
    """
    Operation cycles (sessions) with a failure since the last clear.
    """
    first_onset_s: NotRequired[float | None]
    """
    Onset of the first occurrence, s on the device's clock in its session; null if
    unknown.
    """
    freeze_frame: NotRequired[Evidence | None]
    good_cycles: int
    """
    Consecutive operation cycles without a failure.
    """
    healed: bool
    """
    Whether enough good operation cycles have followed the last failure.
    """
    healing_counter: int
    """
    Good operation cycles of a confirmed fault that count towards healing.
    """
    healing_cycles: int
    """
    Good operation cycles that healing requires.
    """
    in_use: InUse
    kind: NotRequired[FaultKind | None]
    last_onset_s: NotRequired[float | None]
    """
    Onset of the last occurrence, s on the device's clock in its session; null if
    unknown.
    """
    occurrences: int
    """
    Occurrences since the last clear: changes of the test from passed to failed.
    """
    onset_s: NotRequired[float | None]
    """
    Estimated time at which the deviation of the last failure began, s on the device's
    clock in the session of the last occurrence; null if unknown.
    """
    status: FaultStatus
    status_bits: StatusBits
    status_byte: str
    """
    ISO 14229 status byte, two hexadecimal digits.
    """
    tripped_this_cycle: bool
    """
    Whether the current operation cycle has already counted as a trip.
    """
    trips: int
    """
    Operation cycles in which the failure lasted long enough to count as a trip.
    """


class FleetEntry(TypedDict):
    """
    Summary of one asset of the fleet.
    """

    asset: str
    calibrated: bool
    """
    Whether the asset has a calibration.
    """
    communication_lost_since: NotRequired[str | None]
    """
    Time at which the last data arrived, RFC 3339, if the data of the rig stay away although
    its session is open; null otherwise.
    """
    faults: list[FleetFault]
    """
    Pending and confirmed faults, also those of muted monitors.
    """
    lag_s: NotRequired[float | None]
    """
    Delay of the last batch, relative to the smallest delay of a batch in the session, s;
    null until a batch arrives.
    """
    last_seen: NotRequired[str | None]
    """
    Time at which a sample last arrived, RFC 3339. After a restart of the service, and
    until a sample arrives, the time at which the latest session was opened or ended;
    null without a session.
    """
    last_t_s: NotRequired[float | None]
    """
    Time of the last sample, s on the device's clock; null without one.
    """
    learning: LearningState
    """
    State of its automatic calibration.
    """
    muted: NotRequired[list[Mute]]
    """
    Mutes in force: these monitors count as not tested.
    """
    samples: int
    """
    Number of samples recorded in the open session.
    """
    session: NotRequired[str | None]
    """
    Name of the open session; null if no session is open.
    """
    session_id: NotRequired[str | None]
    """
    The service's id of the open session; null if no session is open.
    """
    silent: bool
    """
    Whether a session is open in which no sample has arrived for ten seconds, by the
    service's clock.
    """
    stale: bool
    """
    Whether the node that owns the asset did not answer, so that `last_seen`, `silent`,
    `lag_s` and `unjudged` are not those of now.
    """
    tags: list[str]
    """
    Its tags, in alphabetical order.
    """
    unjudged: NotRequired[Unjudged | None]
    warnings: list[TrendWarning]
    """
    Warnings of expected faults: drifts of a servo from session to session.
    """


class History(TypedDict):
    """
    A change of status of a fault code, or an action of a person.
    """

    at: str
    """
    Time, RFC 3339.
    """
    by: NotRequired[str | None]
    """
    Name of the person who acted; null for a change found by a monitor.
    """
    fault: NotRequired[Fault | None]
    id: int
    """
    Number that increases with every event and action over all assets.
    """
    session_id: NotRequired[str | None]
    """
    The service's id of the session; null if no session was open.
    """
    what: HistoryEvent


class JobWait(TypedDict):
    """
    Why a background job waits.
    """

    n_before: int
    """
    Number of jobs that run or come before it. Further short ones may pass it.
    """
    reason: JobWaitReason


class Judged(TypedDict):
    """
    The result of one monitor in a session.
    """

    candidates: list[Candidate]
    """
    Causes that would explain the evidence equally, heaviest first; empty if there is only
    one.
    """
    code: FaultCode
    judged_s: float
    """
    Time of the session for which it could judge, s.
    """
    judged_share: float
    """
    That time as a fraction of the session from its first to its last sample, 0 to 1.
    """
    kinds: NotRequired[list[NamedKind]]
    """
    The failure modes of its confirmed fault, each with the time at which it was first named;
    absent if there are none, or if an earlier version stored the summary without them.
    """
    outcome: Outcome


class Learning(TypedDict):
    """
    Progress of a rig's automatic calibration.
    """

    asset: str
    by_itself: bool
    """
    Whether the calibration in use was made automatically.
    """
    calibration: NotRequired[str | None]
    """
    Id of the calibration that is running or on offer; null otherwise.
    """
    n_sessions: int
    """
    Number of sessions of the calibration in use or on offer, also of one that a person
    made; while gathering, the number of sessions so far.
    """
    refines: bool
    """
    Whether later healthy sessions refine the calibration in use.
    """
    refused: NotRequired[str | None]
    """
    Why the last calibration failed; null if it did not.
    """
    sessions: list[TeachingSession]
    """
    The sessions gathered so far, or those of the calibration on offer or in use; empty
    if a person made the calibration.
    """
    state: LearningState
    summary: str
    """
    The state in words: what is missing, offered or learnt.
    """
    t_s: NotRequired[float | None]
    """
    Time of the last sample of the open session whose motion is counted, s on the device's
    clock; null without one. While the service has not loaded the rig's engine, for example
    after a restart, the motion is that of the last stored state.
    """
    wanted_s: float
    """
    Motion along each axis that a calibration requires, s; it increases after a failed
    calibration.
    """
    x_s: NotRequired[float | None]
    """
    Usable motion along x so far, s; null if there are no commands or no positions yet.
    """
    y_s: NotRequired[float | None]
    """
    Usable motion along y so far, s; null if there are no commands or no positions yet.
    """


class LeftOut(TypedDict):
    """
    A moment that was not learnt from.
    """

    from_s: float
    """
    Start of the moment on the session's clock, s.
    """
    reason: LeftOutReason
    """
    Why it contradicts the rest.
    """
    session: int
    """
    Number of the session, in the order in which the sessions were given, from 1 on.
    """
    to_s: float
    """
    End of the moment on the session's clock, s.
    """


class Monitor(TypedDict):
    """
    The state of one monitor.
    """

    code: FaultCode
    complete_since_clear: bool
    """
    Whether it has had a result since the code was last cleared.
    """
    complete_this_cycle: bool
    """
    Whether it has had a result in this session.
    """
    counter: int
    """
    Fault detection counter, −128 (passed) to 127 (failed).
    """
    enabled: bool
    """
    Whether its enable condition holds now.
    """
    enabled_s: float
    """
    Former name of `judged_s`, with the same value.
    """
    judged_s: NotRequired[float]
    """
    Time of this session for which it could judge, s.
    """
    judged_share: NotRequired[float]
    """
    That time as a fraction of the session from its first to its last sample, 0 to 1.
    """
    muted: NotRequired[Mute | None]
    t_s: NotRequired[float | None]
    """
    Time of the last judged sample of which this is the state, s on the device's clock; null
    before the first. While the service has not loaded the rig's engine, for example after a
    restart, this is the last stored state.
    """


class Prospects(TypedDict):
    """
    How soon each fault would be confirmed if it occurred during the sessions that the
    calibration learnt from: the median over trials in which the fault was injected into the
    readings. Null if fewer than half of the trials confirmed it within 10 s.
    """

    frozen_s: NotRequired[float | None]
    """
    Median delay for readings that freeze, s.
    """
    stuck_s: NotRequired[float | None]
    """
    Median delay for a ball that sticks, s.
    """
    trials: int
    """
    Number of times at which each fault was injected.
    """
    unseen_s: NotRequired[float | None]
    """
    Median delay for a ball that is not seen, s.
    """
    x: NotRequired[ServoProspects | None]
    y: NotRequired[ServoProspects | None]


class SeriesRow(SeriesValues):
    """
    The results of one session, or of the sessions that were opened within one step.
    """

    faulty: int
    """
    Number of sessions in which a fault was confirmed.
    """
    samples: int
    """
    Number of recorded samples.
    """
    sessions: int
    """
    Number of sessions.
    """
    time: str
    """
    Time at which the session was opened, or at which the step begins, RFC 3339.
    """


class State(TypedDict):
    """
    The state of the twin and the monitors after the last judged sample. While the service has not
    loaded the rig's engine, for example after a restart, this is the last stored state, that of the
    time `t_s`; if none is stored, the twin is at rest, and `judged` is 0 although there are samples.
    """

    asset: str
    evidence: Evidence
    """
    The evidence at the last judged sample.
    """
    fidelity: PlantModel
    """
    The plant model in use.
    """
    fidelity_reason: str
    """
    Why this plant model is in use.
    """
    judged: int
    """
    Number of samples judged in this session.
    """
    learning: NotRequired[Learning | None]
    monitors: list[Monitor]
    """
    The monitors, one for each fault code. Empty if the service has not loaded the rig's
    engine, for example after its process was killed, and no state of the session is stored.
    """
    plate_angle_rad: Xy
    """
    The twin's plate angle that moves the ball along each axis: qy for x, qx for y, rad.
    """
    samples: int
    """
    Number of samples recorded in this session.
    """
    session: NotRequired[str | None]
    """
    Name of the open session; null if no session is open, and then the twin is at rest.
    """
    session_id: NotRequired[str | None]
    """
    The service's id of the open session; null if no session is open.
    """
    t_s: NotRequired[float | None]
    """
    Time of the last judged sample, s on the device's clock; null without one.
    """
    twin_position_m: Xy
    """
    The twin's ball position relative to the plate, m.
    """
    twin_velocity_m_s: Xy
    """
    The twin's ball velocity relative to the plate, m/s.
    """
    unjudged: NotRequired[Unjudged | None]
    waiting: int
    """
    Number of samples that wait for an earlier one, or until a jump of the clock is
    confirmed.
    """


class Summary(TypedDict):
    """
    The last line of a verdict.
    """

    duration_s: float
    """
    Time from the first to the last sample, s.
    """
    faults: list[FaultCode]
    """
    Codes confirmed in this session, in the order of confirmation.
    """
    monitors: NotRequired[list[Judged]]
    """
    Judged time and result of each monitor; empty if an earlier version stored the summary
    without them.
    """
    outcome: NotRequired[Outcome | None]
    rejected: int
    """
    Number of rejected rows.
    """
    residual_x_m_s2: NotRequired[float | None]
    """
    Root mean square of the residual along x while it could be judged, m/s²; null if it
    never could, or if an earlier version stored the summary without it.
    """
    residual_y_m_s2: NotRequired[float | None]
    """
    The same along y.
    """
    samples: int
    """
    Number of recorded samples, without duplicates and rejected rows.
    """
    session: str
    """
    The session's name.
    """
    type: LineType
    """
    Always `summary`.
    """
    verdict_hash: str
    """
    SHA-256 of the number of judged samples and of all transitions, hexadecimal; equal
    judgements have equal hashes.
    """
    warnings: NotRequired[list[Warning]]
    """
    Contradictions between data and asset file; absent if there are none.
    """


class Alarm(TypedDict):
    """
    An alarm: a fault on record, or lost communication.
    """

    acknowledgement: NotRequired[Act | None]
    asset: str
    changed_at: str
    """
    Time at which the record last changed, RFC 3339.
    """
    code: AlarmCode
    communication_lost_since: str | None
    """
    Time at which the last data of the rig arrived, RFC 3339, if data have stopped during an open
    session; null otherwise. What failed then is not known to fail now.
    """
    evidence: AlarmEvidence
    failing: bool
    """
    Whether the last result of its test is a failure.
    """
    kind: NotRequired[FaultKind | None]
    kind_weight: NotRequired[float | None]
    """
    Weight of this kind among the candidates, in (0, 1]; null without a kind.
    """
    muted: NotRequired[Mute | None]
    occurrences: int
    """
    Occurrences since the last clear.
    """
    session_id: NotRequired[str | None]
    """
    The service's id of the session of the last occurrence; null if unknown.
    """
    session_open: bool
    """
    Whether the rig has an open session. Without one, the results of its tests are those of
    a session that has ended.
    """
    since: NotRequired[str | None]
    """
    Time at which the last occurrence was found, RFC 3339; of lost communication the
    arrival of the last data before it. Null if unknown.
    """
    status: FaultStatus
    """
    Status of the fault; of lost communication `confirmed`, or `healed` once data arrive.
    """
    tested: bool
    """
    Whether this result is one of the last session that was opened; false if the test has had
    none in it yet.
    """


class Calibration(TypedDict):
    """
    A calibration: the learnt parameters of a rig and the data they come from.
    """

    certificate: NotRequired[list[MonitorCertificate]]
    """
    Test result and expected false alarms of each monitor; empty if the calibration was
    not tested.
    """
    data_sha256: str
    """
    SHA-256 of the data, hexadecimal.
    """
    duration_s: float
    """
    Duration of the data, s.
    """
    id: NotRequired[str]
    """
    Id of the calibration, a hash of its content, given with every fault; ignored on
    input.
    """
    left_out: NotRequired[list[LeftOut]]
    """
    Moments of the sessions that contradict the rest and were not learnt from.
    """
    made_at: str
    """
    Time of the calibration, RFC 3339.
    """
    prospects: NotRequired[Prospects | None]
    samples: int
    """
    Number of samples of the data.
    """
    sensor: NotRequired[SensorCalibration]
    """
    Learnt properties of the sensor.
    """
    sessions: NotRequired[list[SessionEstimates]]
    """
    Estimates of each session by itself, in the order in which the sessions were given.
    """
    x: NotRequired[AxisCalibration | None]
    y: NotRequired[AxisCalibration | None]


class CalibrationJob(TypedDict):
    """
    A calibration job of an asset, with its result.
    """

    activated_at: NotRequired[str | None]
    """
    Time at which it was put into use last, RFC 3339; null if unknown, or if it never was.
    """
    activated_by: NotRequired[str | None]
    """
    Who put it into use last, as `made_by`; null if unknown, or if it never was.
    """
    active: bool
    """
    Whether this calibration is in use: in the asset file.
    """
    asset: str
    calibration: NotRequired[Calibration | None]
    error: NotRequired[str | None]
    """
    Why it failed, for example what the data lack; null unless the state is `failed`.
    """
    id: str
    made_at: str
    """
    Time of creation, RFC 3339.
    """
    made_by: NotRequired[str | None]
    """
    Who created it: name of the token, or the request's `by` if the service requires none;
    `offbd` if the rig learnt by itself. Null if unknown.
    """
    sessions: list[TrainingData]
    """
    The sessions, or stretches of sessions, it learns from.
    """
    state: JobState
    waits: NotRequired[JobWait | None]


class Difference(TypedDict):
    """
    A difference between the replayed and the recorded verdict.
    """

    change: NotRequired[TransitionChange]
    moved_s: NotRequired[float | None]
    """
    Replayed minus recorded time, s, positive if the replay is later; null if only one
    verdict has the transition.
    """
    recorded: NotRequired[Fault | None]
    replayed: NotRequired[Fault | None]


class FaultEntry(FaultRecord, Provenance):
    """
    The record of one fault code of one asset.
    """

    asset: str
    changed_at: str
    """
    Time at which the record last changed, RFC 3339.
    """
    communication_lost_since: NotRequired[str | None]
    """
    Time at which the last data of the asset arrived, RFC 3339, if data have stopped during an
    open session; null otherwise, and in lists of several assets.
    """
    monitor: NotRequired[Monitor | None]
    session_open: NotRequired[bool | None]
    """
    Whether the asset has an open session; null in lists of several assets.
    """


class Fleet(TypedDict):
    """
    A page of the fleet.
    """

    items: list[FleetEntry]
    missing_nodes: list[str]
    """
    Nodes of the cluster that did not answer in time.
    """
    next: NotRequired[str | None]
    """
    Cursor for the next page; null on the last one.
    """


class ReplayResult(TypedDict):
    """
    The result of a replay.
    """

    calibration_id: NotRequired[str | None]
    """
    Id of the calibration used by the replay; null if the rig was not calibrated.
    """
    differences: list[Difference]
    """
    The transitions that differ, with their fault lines.
    """
    faults: list[Fault]
    """
    The fault lines of the replay.
    """
    recorded_hash: NotRequired[str | None]
    """
    Verdict hash of the record; null while the session is open.
    """
    same: bool
    """
    Whether the two verdicts are equal, transition by transition.
    """
    settings_id: NotRequired[str]
    """
    Id of the profile, settings and rig description used by the replay.
    """
    summary: Summary
    tally: NotRequired[Tally]
    """
    The number of transitions of each change.
    """
    transitions: NotRequired[list[Compared]]
    """
    Every transition of both verdicts, in the order of time.
    """
    truncated: bool
    """
    Whether the verdicts were truncated to 10 000 transitions.
    """


class Series(TypedDict):
    """
    The results of a rig's ended sessions over time.
    """

    aggregate: SeriesAggregate
    """
    How the sessions of a step become one value.
    """
    asset: str
    rows: list[SeriesRow]
    """
    Oldest first; a step without a session has no row.
    """
    step_s: NotRequired[int | None]
    """
    Length of a step, s; null if each row is one session.
    """


class Session(TypedDict):
    """
    A session.
    """

    asset: str
    ended_at: NotRequired[str | None]
    """
    Time at which the session was ended, RFC 3339; null while it is open.
    """
    first_part: NotRequired[str | None]
    """
    The service's id of the first part; null in that itself.
    """
    first_t_s: NotRequired[float | None]
    """
    Earliest time of a sample, s on the device's clock; null without samples.
    """
    id: str
    """
    The service's id of the session.
    """
    last_seq: NotRequired[int | None]
    """
    Highest recorded `seq`; null if no sample has one.
    """
    last_t_s: NotRequired[float | None]
    """
    Latest time of a sample, s on the device's clock; null without samples.
    """
    name: str
    """
    The device's name for the session, or the time at which it was opened.
    """
    opened_at: str
    """
    Time at which the session was opened, RFC 3339.
    """
    part: int
    """
    Number of the part, from 1: a session that has become too long continues in another
    one, whose name ends with the number.
    """
    rejected: int
    """
    Number of rejected rows, which are neither recorded nor judged.
    """
    samples: int
    """
    Number of recorded samples.
    """
    state: SessionState
    verdict: NotRequired[Summary | None]


class Asset(TypedDict):
    """
    The description of a rig by its owner. Everything but `name` has a default: that of
    the default rig (plate 0.38 × 0.24 m, steel ball; see `docs/notation.md`).
    """

    axes: NotRequired[Axes | None]
    ball: NotRequired[Ball]
    calibration: NotRequired[Calibration | None]
    columns: NotRequired[str | None]
    """
    Which columns of the rig's files are which quantities, such as
    `t_s=time/ms, x_m=ball_x/mm` (the parameter `columns` of an import, `--columns` of the
    commands). Used for files that have the columns it names, unless a mapping is given.
    """
    contact: NotRequired[Contact | None]
    diagnostics: NotRequired[Diagnostics | None]
    name: str
    """
    Name of the asset: 1 to 128 letters, digits, `-`, `_` or `.`.
    """
    plate: NotRequired[Plate]
    sample_rate_hz: NotRequired[float]
    """
    Approximate number of samples that the device sends per second.
    """
    servo: NotRequired[Servo]


class Import(TypedDict):
    """
    The result of an import.
    """

    accepted: int
    """
    Number of recorded samples, late ones included.
    """
    duplicate: int
    """
    Number of samples that were already recorded.
    """
    late: int
    """
    Number of samples recorded but not judged.
    """
    more_sessions: NotRequired[list[Session]]
    """
    The sessions of the other runs of the file, whose clock starts again; absent if there are
    none.
    """
    rejected: int
    """
    Number of rejected rows.
    """
    rejections: list[Row]
    """
    The first rejected rows, with their reasons.
    """
    session: Session


class Replay(TypedDict):
    """
    A replay job: judging a recorded session again.
    """

    created_at: str
    """
    Time of creation, RFC 3339.
    """
    error: NotRequired[str | None]
    """
    Why the replay failed; null unless the state is `failed`.
    """
    finished_at: NotRequired[str | None]
    """
    Time of completion or failure, RFC 3339; null before.
    """
    id: str
    progress: float
    """
    Fraction of the samples judged so far, 0 to 1.
    """
    result: NotRequired[ReplayResult | None]
    session_id: str
    settings: ReplaySettings
    state: JobState
    waits: NotRequired[JobWait | None]
