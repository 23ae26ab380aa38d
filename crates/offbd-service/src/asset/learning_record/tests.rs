use super::*;

fn session(id: u32, seconds: f64) -> TrainingSession {
    let motion = MotionSeconds { x: Some(seconds), y: Some(seconds + 1.0) };
    TrainingSession { id: id.to_string(), name: format!("s{id}"), n_samples: 6000, motion }
}

fn ids(sessions: &[TrainingSession]) -> Vec<&str> {
    sessions.iter().map(|t| t.id.as_str()).collect()
}

/// Returns a record with the calibration `job` of sessions 1 and 2 on offer.
fn offered() -> LearningRecord {
    let mut record = LearningRecord::default();
    record.gather(false, session(1, 40.0));
    record.gather(false, session(2, 40.0));
    let due = record.due(false, None).expect("80 s are enough");
    record.begin("job".to_owned(), due, None);
    assert_eq!(record.ended(false, "job", None), CalibrationEnd::Offered);
    record
}

/// Returns a record whose offered calibration was accepted.
fn accepted() -> LearningRecord {
    let mut record = offered();
    record.activated("job");
    record
}

#[test]
fn motion_adds_up_over_sessions_and_the_open_one_until_it_is_enough() {
    let mut record = LearningRecord::default();
    record.gather(false, session(1, 40.0));
    assert_eq!(record.due(false, None), None);
    assert_eq!(record.due(false, Some(&session(2, 19.0))), None);
    let open = session(2, 20.0);
    assert_eq!(ids(&record.due(false, Some(&open)).unwrap()), ["1", "2"]);
    assert_eq!(record.motion(Some(&open)), MotionSeconds { x: Some(60.0), y: Some(62.0) });
    let mut still = session(3, 100.0);
    still.motion.y = Some(0.0);
    assert_eq!(LearningRecord::default().due(false, Some(&still)), None, "no motion along y");
    still.motion.y = None;
    assert!(LearningRecord::default().due(false, Some(&still)).is_some(), "there is no y");
}

#[test]
fn no_calibration_is_started_while_one_is_running_or_offered() {
    let mut record = offered();
    record.gather(false, session(3, 200.0));
    assert_eq!(record.due(false, None), None);
    assert_eq!(record.state(false), LearningState::Offered);
    assert_eq!(record.ended(false, "job", None), CalibrationEnd::NotRequested, "reported twice");
    assert_eq!(record.ended(false, "other", None), CalibrationEnd::NotRequested);
}

#[test]
fn after_a_refusal_half_as_much_motion_again_is_needed() {
    let mut record = LearningRecord::default();
    record.gather(false, session(1, 80.0));
    let due = record.due(false, None).unwrap();
    record.begin("job".to_owned(), due, None);
    assert_eq!(record.ended(false, "job", Some("too still")), CalibrationEnd::Refused);
    assert_eq!((record.wanted_s(), record.state(false)), (120.0, LearningState::Gathering));
    assert_eq!(record.refusal().unwrap().reason, "too still");
    record.gather(false, session(2, 39.0));
    assert_eq!(record.due(false, None), None);
    assert!(record.due(false, Some(&session(3, 1.0))).is_some());
    record.description_changed();
    assert!(record.due(false, None).is_some(), "the refusal was based on another description");
}

#[test]
fn discarded_motion_and_the_rest_of_its_session_are_not_used() {
    let mut record = offered();
    record.discard(Some("3".to_owned()));
    assert_eq!(record.state(false), LearningState::Gathering);
    let open = session(3, 500.0);
    assert_eq!((record.due(false, Some(&open)), record.motion(Some(&open))), Default::default());
    record.gather(false, open);
    assert_eq!(record, LearningRecord::default(), "the session has ended and is not used");
    assert_eq!(record.ended(false, "job", None), CalibrationEnd::NotRequested);
    record.gather(false, session(4, 60.0));
    assert_eq!(ids(&record.due(false, None).unwrap()), ["4"]);
}

#[test]
fn an_accepted_calibration_is_refined_until_it_is_based_on_five_sessions() {
    let mut record = accepted();
    assert!(record.refines());
    record.gather(true, session(3, 29.0));
    assert_eq!(record.due(true, None), None, "too little motion");
    for id in 3..=5 {
        record.gather(true, session(id, 30.0));
        let due = record.due(true, None).unwrap();
        assert_eq!(due.len(), id as usize);
        record.begin(id.to_string(), due, None);
        assert_eq!(record.ended(true, &id.to_string(), None), CalibrationEnd::Refines);
    }
    assert!(!record.refines() && record.is_automatic());
    record.gather(true, session(6, 100.0));
    assert_eq!(record.due(true, None), None, "no further refinement");
}

#[test]
fn a_refused_refinement_changes_nothing_and_its_session_is_removed() {
    let mut record = accepted();
    record.gather(true, session(3, 40.0));
    let due = record.due(true, None).unwrap();
    record.begin("more".to_owned(), due, None);
    assert_eq!(record.ended(true, "more", Some("it accuses itself")), CalibrationEnd::Refused);
    assert_eq!(ids(&record.taught), ["1", "2"]);
    assert_eq!(record.due(true, None), None);
    record.gather(true, session(4, 40.0));
    assert_eq!(ids(&record.due(true, None).unwrap()), ["1", "2", "4"]);
}

#[test]
fn a_calibration_by_a_person_is_never_refined() {
    let by_hand: [fn(&mut LearningRecord); 2] =
        [|r| r.activated("other"), LearningRecord::calibration_replaced];
    for by_hand in by_hand {
        for mut record in [LearningRecord::default(), offered(), accepted()] {
            by_hand(&mut record);
            record.gather(true, session(7, 100.0));
            assert_eq!((record.due(true, None), record.is_automatic()), (None, false));
        }
    }
}

#[test]
fn the_gathered_sessions_are_within_the_limits_of_a_calibration() {
    let mut record = LearningRecord::default();
    for id in 0..40 {
        record.gather(false, session(id, 1.0));
    }
    assert_eq!(record.motion(None).x, Some(40.0), "the motion of removed sessions still counts");
    assert_eq!(record.sessions.len(), MAX_CALIBRATION_SESSIONS);
    let long =
        |id| TrainingSession { n_samples: MAX_CALIBRATION_SAMPLES as i64, ..session(id, 100.0) };
    record.gather(false, long(40));
    assert_eq!(ids(&record.due(false, None).unwrap()), ["40"]);
    record.gather(false, session(41, 100.0));
    assert_eq!(ids(&record.due(false, None).unwrap()), ["41"]);
}

#[test]
fn a_deleted_session_is_not_used() {
    let mut record = LearningRecord::default();
    record.gather(false, session(1, 80.0));
    assert!(!record.remove("2", false));
    assert!(record.remove("1", false));
    assert_eq!(record, LearningRecord::default());
}

#[test]
fn the_record_survives_serialization() {
    for record in [LearningRecord::default(), offered(), accepted()] {
        let document = serde_json::to_string(&record).unwrap();
        assert_eq!(serde_json::from_str::<LearningRecord>(&document).unwrap(), record);
    }
}
