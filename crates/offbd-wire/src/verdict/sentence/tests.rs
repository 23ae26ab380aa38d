use super::*;
use offbd_core::diagnosis::ServoAnswer;
use offbd_core::diagnosis::{PositionJump, StatusByte};
use offbd_core::vocabulary::{PerAxis, SimTime};

/// Evidence in which all quantities are known.
fn evidence() -> Evidence {
    let answer = ServoAnswer {
        offset_m_s2: 0.3,
        offset_error_m_s2: 0.02,
        gain: 0.52,
        gain_error: 0.06,
        delay_s: 0.25,
        delay_error_s: 0.03,
        ..ServoAnswer::default()
    };
    let x = AxisEvidence {
        measured_m_s2: Some(0.05),
        twin_m_s2: Some(-0.2),
        limit_m_s2: 0.21,
        enabled: true,
        nats: 14.0,
        answer: Some(answer),
        identical_s: 1.25,
        ..AxisEvidence::default()
    };
    Evidence {
        axes: PerAxis { x, y: AxisEvidence { nats: 9.0, ..AxisEvidence::default() } },
        unseen_s: 0.75,
        missing_share: 0.62,
        identical_s: 1.25,
        still_s: 1.5,
        outliers: 7,
        scatter_m: Some(3e-3),
        healthy_scatter_m: 2e-4,
        jump: Some(PositionJump { at_s: 4.97, size_m: 0.1 }),
        ..Evidence::default()
    }
}

/// A confirmed failure of `code` with `kind` and `evidence`.
fn failure(code: FaultCode, kind: Option<FaultKind>, evidence: Evidence) -> Transition {
    let mut byte = StatusByte::default();
    byte.failed();
    byte.confirm(false);
    let suspicion = Suspicion { onset: SimTime::new(4.5), kind, candidates: Vec::new() };
    let at = SimTime::new(5.25).unwrap();
    Transition { at, code, status: FaultStatus::Confirmed, byte, suspicion, evidence }
}

/// Returns the part of the sentence after name, status and onset.
fn findings_of(code: FaultCode, kind: Option<FaultKind>, evidence: Evidence) -> String {
    let sentence = sentence(&failure(code, kind, evidence));
    let (head, findings) = sentence.split_once(": ").unwrap();
    assert_eq!(
        head,
        format!("{} confirmed since 4.50 s", fault_title(code_title(code), kind, 1.0))
    );
    findings.to_owned()
}

#[test]
fn regress_the_sentence_of_a_sensor_fault_depends_on_its_kind() {
    let cases = [
        (FaultKind::Jump, "readings stepped by 100 mm at 4.97 s"),
        (FaultKind::Noise, "readings scatter by 3.00 mm where healthy ones do by 0.20 mm"),
        (FaultKind::Spikes, "7 lone readings far off the ball's path in 10 s"),
        (FaultKind::Dropout, "no ball seen for 0.8 s, and in 62 % of recent samples"),
        (FaultKind::Frozen, "readings have been unchanged for 1.2 s"),
    ];
    for (kind, wanted) in cases {
        assert_eq!(findings_of(FaultCode::Sensor, Some(kind), evidence()), wanted);
    }
    let one = Evidence { identical_s: 0.0, ..evidence() };
    assert_eq!(
        findings_of(FaultCode::Sensor, Some(FaultKind::Frozen), one),
        "readings along x have been unchanged for 1.2 s while those along y change"
    );
    let seen = Evidence { unseen_s: 0.0, ..evidence() };
    assert_eq!(
        findings_of(FaultCode::Sensor, Some(FaultKind::Dropout), seen),
        "no ball seen in 62 % of recent samples"
    );
}

#[test]
fn regress_the_sentence_of_a_servo_fault_depends_on_its_kind() {
    let cases = [
        (Some(FaultKind::Dead), "does not respond (52 ± 6 % of qy)"),
        (Some(FaultKind::Held), "holds its angle whatever the command (52 ± 6 % of qy)"),
        (Some(FaultKind::Reversed), "moves in the wrong direction (52 ± 6 % of qy)"),
        (
            Some(FaultKind::Gain),
            "responds with 52 ± 6 % of qy with an unexplained acceleration of +0.30 m/s²",
        ),
        (
            Some(FaultKind::Offset),
            "has a constant error, which accelerates the ball by +0.30 ± 0.02 m/s²",
        ),
        (Some(FaultKind::Slow), "responds 0.25 ± 0.03 s late"),
        (Some(FaultKind::Intermittent), "fails intermittently"),
        (None, "responds with 52 ± 6 % of qy with an unexplained acceleration of +0.30 m/s²"),
    ];
    for (kind, wanted) in cases {
        let rest = "acceleration along x: measured 0.05 m/s², expected -0.20 m/s² (limit 0.21)";
        let wanted = format!("the x servo {wanted}; {rest}");
        assert_eq!(findings_of(FaultCode::XServo, kind, evidence()), wanted);
    }
}

/// The kind is named from a half on, long before it is sure.
#[test]
fn a_kind_that_is_only_probable_is_not_told_as_a_fact() {
    let of = |weight| {
        let kind = |kind, weight| Candidate { code: FaultCode::XServo, kind: Some(kind), weight };
        let mut dead = failure(FaultCode::XServo, Some(FaultKind::Dead), evidence());
        dead.suspicion.candidates =
            vec![kind(FaultKind::Dead, weight), kind(FaultKind::Held, 1.0 - weight)];
        dead
    };
    let doubtful = sentence(&of(0.512));
    let wanted =
        "X servo (probably dead, 51 %) confirmed since 4.50 s: the x servo probably does not ";
    assert!(doubtful.starts_with(wanted), "{doubtful}");
    let sure = sentence(&of(0.9));
    let wanted = "X servo (dead) confirmed since 4.50 s: the x servo does not ";
    assert!(sure.starts_with(wanted), "{sure}");
    let mut passing = of(0.512);
    passing.byte.passed();
    let passing = sentence(&passing);
    assert!(
        passing.starts_with("X servo (probably dead, 51 %) passes its test again"),
        "{passing}"
    );
}

#[test]
fn regress_a_still_ball_and_a_slow_ball_have_different_sentences() {
    assert_eq!(
        findings_of(FaultCode::StuckBall, None, evidence()),
        "the ball has stood still for 1.5 s while the plate asks it to move"
    );
    let slow = Evidence { still_s: 0.1, ..evidence() };
    assert_eq!(
        findings_of(FaultCode::StuckBall, None, slow),
        "the ball hardly moves although the plate asks it to along both axes (evidence 23 nats)"
    );
}

/// Evidence against both servos points to what they share; less against one of them does not.
#[test]
fn a_supply_is_named_if_both_servos_deviate() {
    let told = |nats: f64| {
        let mut both = evidence();
        both.axes.y.nats = nats;
        findings_of(FaultCode::XServo, Some(FaultKind::Dead), both)
    };
    let supply = "; the y servo deviates, too: measure their supply";
    assert!(told(10.0).ends_with(supply), "{}", told(10.0));
    assert!(!told(9.9).contains("supply"), "{}", told(9.9));
}

#[test]
fn regress_all_candidates_are_named_the_heaviest_first() {
    let servo = Candidate { code: FaultCode::XServo, kind: Some(FaultKind::Dead), weight: 0.7 };
    let ball = Candidate { code: FaultCode::StuckBall, kind: None, weight: 0.3 };
    let mut alike = failure(FaultCode::StuckBall, None, evidence());
    alike.suspicion.candidates = vec![servo, ball];
    alike.evidence.axes.y.command_rad = Some(0.0);
    assert_eq!(
        sentence(&alike),
        "Stuck ball confirmed since 4.50 s: cannot tell x servo (dead) 70 % from stuck ball 30 %; \
         the ball has stood still for 1.5 s while the plate asks it to move; tilting by qx would \
         decide, as the drive cycle does: a ball that then rolls along y is not stuck"
    );
    alike.evidence.axes.y.command_rad = None;
    assert!(
        sentence(&alike)
            .ends_with("; a push by hand would decide: a ball that then rolls is not stuck")
    );
    let dead = |axis| Candidate { code: FaultCode::servo(axis), weight: 0.25, ..servo };
    let ball = Candidate { weight: 0.5, ..ball };
    alike.suspicion.candidates = vec![ball, dead(Axis::X), dead(Axis::Y)];
    assert_eq!(
        sentence(&alike),
        "Stuck ball confirmed since 4.50 s: cannot tell stuck ball 50 % from both servos (dead) 50 %; \
         the ball has stood still for 1.5 s while the plate asks it to move; a push by hand would \
         decide: if the ball then rolls, look whether both servos have power"
    );
    let frozen = Candidate { code: FaultCode::Sensor, kind: Some(FaultKind::Frozen), weight: 0.7 };
    let mut readings = failure(FaultCode::Sensor, Some(FaultKind::Frozen), evidence());
    readings.suspicion.candidates = vec![frozen, ball];
    assert!(sentence(&readings).ends_with(
        "; moving the ball by hand would decide: readings that then stay the same are frozen"
    ));
    let kind = |kind, weight| Candidate { code: FaultCode::XServo, kind: Some(kind), weight };
    let mut kinds = failure(FaultCode::XServo, None, evidence());
    kinds.suspicion.candidates =
        vec![kind(FaultKind::Dead, 0.4), kind(FaultKind::Held, 0.35), kind(FaultKind::Gain, 0.25)];
    let text = sentence(&kinds);
    let wanted =
        "X servo confirmed since 4.50 s: cannot tell which kind: dead 40 %, held 35 %, gain 25 %; ";
    assert!(text.starts_with(wanted), "{text}");
}

#[test]
fn regress_a_test_that_passes_again_is_not_reported_as_a_failure() {
    let mut passing = failure(FaultCode::Sensor, Some(FaultKind::Jump), evidence());
    passing.byte.passed();
    assert_eq!(
        sentence(&passing),
        "Position sensor (jump) passes its test again since 5.25 s; it was confirmed"
    );
}

/// The path is mentioned only if its evidence exceeds its limit and the residual does not.
#[test]
fn the_path_is_mentioned_if_it_is_the_reason() {
    let reason = |enabled: bool, nats: f64| {
        let mut evidence = evidence();
        let x = &mut evidence.axes.x;
        (x.enabled, x.path_nats, x.path_limit_nats) = (enabled, Some(nats), Some(6.0));
        findings_of(FaultCode::XServo, None, evidence)
    };
    let path = "(its path is evidence of 9 nats, limit 6 nats)";
    assert!(reason(false, 9.1).ends_with(path), "{}", reason(false, 9.1));
    assert!(reason(false, 5.0).ends_with("(evidence 14 nats)"));
    assert!(reason(true, 9.1).ends_with("(limit 0.21)"));
}

/// People know a pending fault as a suspected one, and a cleared one leaves nothing to tell.
#[test]
fn regress_the_words_of_a_status() {
    let mut transition = failure(FaultCode::XServo, Some(FaultKind::Dead), evidence());
    transition.status = FaultStatus::Pending;
    let suspected = sentence(&transition);
    assert!(suspected.starts_with("X servo (dead) suspected since 4.50 s: "), "{suspected}");
    transition.status = FaultStatus::Cleared;
    assert_eq!(sentence(&transition), "X servo (dead) cleared");
}
