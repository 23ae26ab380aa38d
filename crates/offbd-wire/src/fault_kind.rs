//! What people are told about a kind of fault: one row for each kind.

use offbd_core::diagnosis::{Evidence, ServoAnswer};
use offbd_core::vocabulary::{Axis, FaultKind};

/// The texts of a kind of fault.
pub(crate) struct KindText {
    kind: FaultKind,
    pub finding: Finding,
    /// A few checks that a person can make, the likeliest cause first.
    pub checks: &'static [&'static str],
}

/// Describes the evidence in a clause; `None` without a number that the clause needs.
#[derive(Clone, Copy)]
pub(crate) enum Finding {
    /// Of a servo, from its response to its command; the clause goes on after "the servo".
    Servo(fn(Axis, &ServoAnswer) -> Option<String>),
    /// Of the sensor.
    Readings(fn(&Evidence) -> Option<String>),
}

/// The texts of every kind, in the order of [`FaultKind::ALL`].
static KINDS: [KindText; FaultKind::ALL.len()] = [
    KindText {
        kind: FaultKind::Dead,
        finding: Finding::Servo(|axis, answer| {
            Some(format!("does not respond{}", known(axis, answer)))
        }),
        checks: &[
            "Does the servo have power? Measure the supply at its plug.",
            "Is the signal cable plugged in, and on the right channel?",
            "Turn the horn by hand with the power off: does the motor turn with it?",
        ],
    },
    KindText {
        kind: FaultKind::Held,
        finding: Finding::Servo(|axis, answer| {
            Some(format!("holds its angle whatever the command{}", known(axis, answer)))
        }),
        checks: &[
            "Does something block the linkage? Move the plate by hand with the power off.",
            "Is the servo hot, or does it hum? Let it cool and look for a jammed gear.",
            "Does the controller still send new commands?",
        ],
    },
    KindText {
        kind: FaultKind::Gain,
        finding: Finding::Servo(answered_share),
        checks: &[
            "Is the horn screw tight, and is the linkage in the right hole?",
            "Measure the supply while the servo moves: does the voltage drop?",
            "If the linkage was changed on purpose, calibrate the rig again.",
        ],
    },
    KindText {
        kind: FaultKind::Reversed,
        finding: Finding::Servo(|axis, answer| {
            Some(format!("moves in the wrong direction{}", known(axis, answer)))
        }),
        checks: &[
            "Was the servo replaced or its horn reversed?",
            "Compare the sign of the axis in the rig's description with a small tilt by hand.",
        ],
    },
    KindText {
        kind: FaultKind::Offset,
        finding: Finding::Servo(|_, answer| {
            let (off, error) = (answer.offset_m_s2, answer.offset_error_m_s2);
            Some(format!(
                "has a constant error, which accelerates the ball by {off:+.2} ± \
                 {error:.2} m/s²"
            ))
        }),
        checks: &[
            "Is the plate level at zero command? Put a spirit level on it.",
            "Has the horn slipped on its teeth? Look at the horn screw.",
            "Was the rig moved to another table? Then level it or calibrate it again.",
        ],
    },
    KindText {
        kind: FaultKind::Slow,
        finding: Finding::Servo(|_, answer| {
            let (late, error) = (answer.delay_s, answer.delay_error_s);
            Some(match late > error {
                true => format!("responds {late:.2} ± {error:.2} s late"),
                false => "responds late".to_owned(),
            })
        }),
        checks: &[
            "Measure the supply under load; a weak supply makes a servo slow.",
            "Does the linkage move freely, without friction?",
            "Is the controller busy, or does the link delay the commands?",
        ],
    },
    KindText {
        kind: FaultKind::Intermittent,
        finding: Finding::Servo(|_, _| Some("fails intermittently".to_owned())),
        checks: &[
            "Move the cable and the plug while the servo works: a loose contact shows.",
            "Look for a worn gear: does the servo skip at one angle?",
            "Measure the supply under load.",
        ],
    },
    KindText {
        kind: FaultKind::Frozen,
        finding: Finding::Readings(|evidence| Some(repeated(evidence))),
        checks: &[
            "Does the sensor's program still run? Start it again.",
            "Is the cable of the sensor plugged in?",
            "Move the ball by hand: do the readings change?",
        ],
    },
    KindText {
        kind: FaultKind::Dropout,
        finding: Finding::Readings(|evidence| Some(unseen(evidence))),
        checks: &[
            "Is there a ball on the plate, and is it in view?",
            "Camera: look at light, focus and exposure. Touch panel: clean it.",
            "Look at the cable of the sensor.",
        ],
    },
    KindText {
        kind: FaultKind::Noise,
        finding: Finding::Readings(|evidence| {
            Some(format!(
                "readings scatter by {:.2} mm where healthy ones do by {:.2} mm",
                1e3 * evidence.scatter_m?,
                1e3 * evidence.healthy_scatter_m
            ))
        }),
        checks: &[
            "Camera: look at light and focus. Touch panel: clean it, look at its ground wire.",
            "Are motor cables laid beside the cable of the sensor?",
        ],
    },
    KindText {
        kind: FaultKind::Spikes,
        finding: Finding::Readings(|evidence| {
            let n = evidence.outliers;
            Some(format!("{n} lone readings far off the ball's path in 10 s"))
        }),
        checks: &[
            "Camera: are there reflections or a second object of the ball's colour?",
            "Touch panel: clean it and look at its plug.",
        ],
    },
    KindText {
        kind: FaultKind::Jump,
        finding: Finding::Readings(|evidence| {
            let step = evidence.jump?;
            let (mm, at_s) = (1e3 * step.size_m, step.at_s);
            Some(format!("readings stepped by {mm:.0} mm at {at_s:.2} s"))
        }),
        checks: &[
            "Was the camera or the panel moved? Fasten it and calibrate the rig again.",
            "Did the sensor's program start again with another origin?",
        ],
    },
];

const _: () = {
    let mut i = 0;
    while i < KINDS.len() {
        assert!(KINDS[i].kind as usize == i, "a kind is missing, or in another place");
        i += 1;
    }
};

/// Returns the texts of `kind`.
pub(crate) fn kind_text(kind: FaultKind) -> &'static KindText {
    &KINDS[kind as usize]
}

/// Largest standard error with which a gain is mentioned.
const MAX_REPORTED_GAIN_ERROR: f64 = 0.3;

/// Describes the share of its command with which a servo responds, after "the servo"; `None` if it
/// is too uncertain.
pub(crate) fn answered_share(axis: Axis, answer: &ServoAnswer) -> Option<String> {
    Some(format!("responds with {}{}", share(axis, answer)?, unexplained(answer)))
}

/// Describes the gain as a share of the command; `None` if it is too uncertain.
fn share(axis: Axis, answer: &ServoAnswer) -> Option<String> {
    let (gain, error, command) = (100.0 * answer.gain, 100.0 * answer.gain_error, axis.command());
    (answer.gain_error <= MAX_REPORTED_GAIN_ERROR)
        .then(|| format!("{gain:.0} ± {error:.0} % of {command}"))
}

/// The gain in brackets; empty if it is too uncertain.
fn known(axis: Axis, answer: &ServoAnswer) -> String {
    share(axis, answer).map(|share| format!(" ({share})")).unwrap_or_default()
}

/// Describes the acceleration that no command explains; empty if it is not significant.
fn unexplained(answer: &ServoAnswer) -> String {
    let off = answer.offset_m_s2;
    match off.abs() > 2.0 * answer.offset_error_m_s2 {
        true => format!(" with an unexplained acceleration of {off:+.2} m/s²"),
        false => String::new(),
    }
}

fn unseen(evidence: &Evidence) -> String {
    let share = format!("in {:.0} % of recent samples", 100.0 * evidence.missing_share);
    match evidence.unseen_s > 0.0 {
        true => format!("no ball seen for {:.1} s, and {share}", evidence.unseen_s),
        false => format!("no ball seen {share}"),
    }
}

/// Identical readings along one axis, or along both.
fn repeated(evidence: &Evidence) -> String {
    if evidence.identical_s > 0.0 {
        return format!("readings have been unchanged for {:.1} s", evidence.identical_s);
    }
    let of = |axis: Axis| evidence.axes[axis].identical_s;
    let axis = if of(Axis::X) >= of(Axis::Y) { Axis::X } else { Axis::Y };
    let (own, other) = (axis.as_str(), axis.other().as_str());
    format!(
        "readings along {own} have been unchanged for {:.1} s while those along {other} change",
        of(axis)
    )
}
