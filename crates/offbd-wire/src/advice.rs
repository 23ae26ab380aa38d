//! What to do about an alarm: a few checks that a person can make, the likeliest cause first.
//! Chosen from how the parts of such rigs fail.

use super::alarm::AdviceView;
use super::words::{AlarmCodeWord, KindWord};

/// Returns the advice on each code: of its kinds that have their own, and the rest.
#[must_use]
pub fn all() -> Vec<AdviceView> {
    let of_code = |&code: &AlarmCodeWord| {
        let kinds = kinds(code).iter().copied().map(Some).chain([None]);
        kinds.map(move |kind| AdviceView {
            code,
            kind,
            checks: checks(code, kind).iter().map(|&check| check.to_owned()).collect(),
        })
    };
    AlarmCodeWord::ALL.iter().flat_map(of_code).collect()
}

/// The kinds of a code that have their own advice.
const fn kinds(code: AlarmCodeWord) -> &'static [KindWord] {
    use KindWord::{
        Dead, Dropout, Frozen, Gain, Held, Intermittent, Jump, Noise, Offset, Reversed, Slow,
        Spikes,
    };
    match code {
        AlarmCodeWord::XServo | AlarmCodeWord::YServo => {
            &[Dead, Held, Gain, Reversed, Offset, Slow, Intermittent]
        }
        AlarmCodeWord::Sensor => &[Frozen, Dropout, Noise, Spikes, Jump],
        AlarmCodeWord::StuckBall | AlarmCodeWord::CommunicationLost => &[],
    }
}

/// Returns the checks for a code and a kind; for a kind without its own advice, those of the
/// code.
#[must_use]
pub const fn checks(code: AlarmCodeWord, kind: Option<KindWord>) -> &'static [&'static str] {
    match code {
        AlarmCodeWord::XServo | AlarmCodeWord::YServo => servo(kind),
        AlarmCodeWord::Sensor => sensor(kind),
        AlarmCodeWord::StuckBall => &[
            "Push the ball by hand: does it roll freely?",
            "Clean the plate and the ball; look for something sticky or a dent.",
            "Is the ball caught at the rim, a cable or a screw?",
        ],
        AlarmCodeWord::CommunicationLost => &[
            "Is the rig switched on, and does its program run?",
            "Can the rig reach this service? Look at its network and at its log.",
            "If it was switched off on purpose, end its session.",
        ],
    }
}

const fn servo(kind: Option<KindWord>) -> &'static [&'static str] {
    match kind {
        Some(KindWord::Dead) => &[
            "Has the servo power? Measure the supply at its plug.",
            "Is the signal cable plugged in, and on the right channel?",
            "Turn the horn by hand with the power off: does the motor turn with it?",
        ],
        Some(KindWord::Held) => &[
            "Does something block the linkage? Move the plate by hand with the power off.",
            "Is the servo hot, or does it hum? Let it cool and look for a jammed gear.",
            "Does the controller still send new commands?",
        ],
        Some(KindWord::Gain) => &[
            "Is the horn screw tight, and is the linkage in the right hole?",
            "Measure the supply while the servo moves: does the voltage drop?",
            "If the linkage was changed on purpose, learn the rig again.",
        ],
        Some(KindWord::Reversed) => &[
            "Was the servo replaced or its horn turned round?",
            "Compare the sign of the axis in the rig's description with a small tilt by hand.",
        ],
        Some(KindWord::Offset) => &[
            "Is the plate level at zero command? Put a spirit level on it.",
            "Has the horn slipped on its teeth? Look at the horn screw.",
            "Was the rig moved to another table? Then level it or learn it again.",
        ],
        Some(KindWord::Slow) => &[
            "Measure the supply under load; a weak supply makes a servo slow.",
            "Does the linkage move freely, without friction?",
            "Is the controller busy, or does the link delay the commands?",
        ],
        Some(KindWord::Intermittent) => &[
            "Move the cable and the plug while the servo works: a loose contact shows.",
            "Look for a worn gear: does the servo skip at one angle?",
            "Measure the supply under load.",
        ],
        // No kind of a servo.
        Some(
            KindWord::Frozen
            | KindWord::Dropout
            | KindWord::Noise
            | KindWord::Spikes
            | KindWord::Jump,
        )
        | None => &[
            "Has the servo power, and is its cable plugged in?",
            "Is the horn screw tight, and does the linkage move freely?",
            "Run the drive cycle: it tells which kind of fault it is.",
        ],
    }
}

const fn sensor(kind: Option<KindWord>) -> &'static [&'static str] {
    match kind {
        Some(KindWord::Frozen) => &[
            "Does the sensor's program still run? Start it again.",
            "Is the cable of the sensor plugged in?",
            "Move the ball by hand: do the readings change?",
        ],
        Some(KindWord::Dropout) => &[
            "Is there a ball on the plate, and is it in view?",
            "Camera: look at light, focus and exposure. Touch panel: clean it.",
            "Look at the cable of the sensor.",
        ],
        Some(KindWord::Noise) => &[
            "Camera: look at light and focus. Touch panel: clean it, look at its ground wire.",
            "Are motor cables laid beside the cable of the sensor?",
        ],
        Some(KindWord::Spikes) => &[
            "Camera: are there reflections or a second object of the ball's colour?",
            "Touch panel: clean it and look at its plug.",
        ],
        Some(KindWord::Jump) => &[
            "Was the camera or the panel moved? Fasten it and learn the rig again.",
            "Did the sensor's program start again with another origin?",
        ],
        // No kind of a sensor.
        Some(
            KindWord::Dead
            | KindWord::Held
            | KindWord::Gain
            | KindWord::Reversed
            | KindWord::Offset
            | KindWord::Slow
            | KindWord::Intermittent,
        )
        | None => &[
            "Move the ball by hand: do the readings follow it?",
            "Camera: look at light and focus. Touch panel: clean it and look at its plug.",
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_and_kind_has_two_or_three_checks_of_one_line() {
        let advice = all();
        assert!(advice.len() > AlarmCodeWord::ALL.len());
        for AdviceView { code, kind, checks } in &advice {
            assert!((2..=3).contains(&checks.len()), "{code} {kind:?}");
            assert!(checks.iter().all(|check| check.len() <= 100), "{code} {kind:?}");
        }
        let servos = [AlarmCodeWord::XServo, AlarmCodeWord::YServo, AlarmCodeWord::Sensor];
        for kind in KindWord::ALL {
            let told = |code: &AlarmCodeWord| {
                advice.iter().any(|a| a.code == *code && a.kind == Some(*kind))
            };
            assert!(servos.iter().any(told), "{kind}");
        }
    }
}
