//! What to do about an alarm: a few checks that a person can make, the likeliest cause first.
//! Chosen from how the parts of such rigs fail.

use super::alarm::AdviceView;
use super::fault_kind::{Finding, KindText, kind_text};
use super::words::{AlarmCodeWord, KindWord};

/// Returns the advice on each code: of its kinds that have their own, and the rest.
#[must_use]
pub fn all() -> Vec<AdviceView> {
    let of_code = |&code: &AlarmCodeWord| {
        let kinds = kinds(code).map(Some).chain([None]);
        kinds.map(move |kind| AdviceView {
            code,
            kind,
            checks: checks(code, kind).iter().map(|&check| check.to_owned()).collect(),
        })
    };
    AlarmCodeWord::ALL.iter().flat_map(of_code).collect()
}

/// The kinds of a code, each of which has its own advice.
fn kinds(code: AlarmCodeWord) -> impl Iterator<Item = KindWord> {
    KindWord::ALL.iter().copied().filter(move |kind| own_checks(code, *kind).is_some())
}

/// The advice on a kind of fault; `None` if no fault of the code has this kind.
fn own_checks(code: AlarmCodeWord, kind: KindWord) -> Option<&'static [&'static str]> {
    let KindText { finding, checks, .. } = kind_text(kind.into());
    let is_of_code = match code {
        AlarmCodeWord::XServo | AlarmCodeWord::YServo => matches!(finding, Finding::Servo(_)),
        AlarmCodeWord::Sensor => matches!(finding, Finding::Readings(_)),
        AlarmCodeWord::StuckBall | AlarmCodeWord::CommunicationLost => false,
    };
    is_of_code.then_some(*checks)
}

/// Returns the checks for a code and a kind; for a kind without its own advice, those of the
/// code.
#[must_use]
pub fn checks(code: AlarmCodeWord, kind: Option<KindWord>) -> &'static [&'static str] {
    if let Some(checks) = kind.and_then(|kind| own_checks(code, kind)) {
        return checks;
    }
    match code {
        AlarmCodeWord::XServo | AlarmCodeWord::YServo => &[
            "Does the servo have power, and is its cable plugged in?",
            "Is the horn screw tight, and does the linkage move freely?",
            "Run the drive cycle: it tells which kind of fault it is.",
        ],
        AlarmCodeWord::Sensor => &[
            "Move the ball by hand: do the readings follow it?",
            "Camera: look at light and focus. Touch panel: clean it and look at its plug.",
        ],
        AlarmCodeWord::StuckBall => &[
            "Push the ball by hand: does it roll freely? If so, do both servos have power?",
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
