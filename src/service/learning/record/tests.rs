use super::*;

fn session(id: u32, seconds: f64) -> Teaching {
    let motion = Seconds { x: Some(seconds), y: Some(seconds + 1.0) };
    Teaching { id: id.to_string(), name: format!("s{id}"), n_samples: 6000, motion }
}

fn ids(teaching: &[Teaching]) -> Vec<&str> {
    teaching.iter().map(|t| t.id.as_str()).collect()
}

/// A record whose rig has gathered, learnt and offered `job` from sessions 1 and 2.
fn offered() -> Record {
    let mut record = Record::default();
    record.gather(false, session(1, 40.0));
    record.gather(false, session(2, 40.0));
    let due = record.due(false, None).expect("80 s are enough");
    record.begin("job".to_owned(), due, None);
    assert_eq!(record.ended(false, "job", None), CalibrationEnd::Offered);
    record
}

/// The same, accepted.
fn taught() -> Record {
    let mut record = offered();
    record.activated("job");
    record
}

#[test]
fn motion_adds_up_over_sessions_and_the_open_one_until_it_is_enough() {
    let mut record = Record::default();
    record.gather(false, session(1, 40.0));
    assert_eq!(record.due(false, None), None);
    assert_eq!(record.due(false, Some(&session(2, 19.0))), None);
    let open = session(2, 20.0);
    assert_eq!(ids(&record.due(false, Some(&open)).unwrap()), ["1", "2"]);
    assert_eq!(record.motion(Some(&open)), Seconds { x: Some(60.0), y: Some(62.0) });
    let mut still = session(3, 100.0);
    still.motion.y = Some(0.0);
    assert_eq!(Record::default().due(false, Some(&still)), None, "y has not moved");
    still.motion.y = None;
    assert!(Record::default().due(false, Some(&still)).is_some(), "there is no y");
}

#[test]
fn nothing_more_is_begun_while_a_calibration_is_under_way_or_offered() {
    let mut record = offered();
    record.gather(false, session(3, 200.0));
    assert_eq!(record.due(false, None), None);
    assert_eq!(record.state(false), LearningState::Offered);
    assert_eq!(record.ended(false, "job", None), CalibrationEnd::NotAsked, "told twice");
    assert_eq!(record.ended(false, "other", None), CalibrationEnd::NotAsked);
}

#[test]
fn after_a_refusal_half_as_much_again_is_wanted() {
    let mut record = Record::default();
    record.gather(false, session(1, 80.0));
    let due = record.due(false, None).unwrap();
    record.begin("job".to_owned(), due, None);
    assert_eq!(record.ended(false, "job", Some("too still")), CalibrationEnd::Refused);
    assert_eq!((record.wanted_s(), record.state(false)), (120.0, LearningState::Gathering));
    assert_eq!(record.refusal().unwrap().reason, "too still");
    record.gather(false, session(2, 39.0));
    assert_eq!(record.due(false, None), None);
    assert!(record.due(false, Some(&session(3, 1.0))).is_some());
    record.described();
    assert!(record.due(false, None).is_some(), "another description may explain it");
}

#[test]
fn what_was_discarded_does_not_teach_nor_does_the_rest_of_its_session() {
    let mut record = offered();
    record.discard(Some("3".to_owned()));
    assert_eq!(record.state(false), LearningState::Gathering);
    let open = session(3, 500.0);
    assert_eq!((record.due(false, Some(&open)), record.motion(Some(&open))), Default::default());
    record.gather(false, open);
    assert_eq!(record, Record::default(), "it has ended, and nothing of it is left");
    assert_eq!(record.ended(false, "job", None), CalibrationEnd::NotAsked);
    record.gather(false, session(4, 60.0));
    assert_eq!(ids(&record.due(false, None).unwrap()), ["4"]);
}

#[test]
fn an_accepted_calibration_is_refined_until_five_sessions_have_taught() {
    let mut record = taught();
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
    assert!(!record.refines() && record.by_itself());
    record.gather(true, session(6, 100.0));
    assert_eq!(record.due(true, None), None, "it stays as it is");
}

#[test]
fn a_refused_refinement_changes_nothing_and_its_session_is_left_out() {
    let mut record = taught();
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
fn what_somebody_made_is_never_refined() {
    let by_hand: [fn(&mut Record); 2] = [|r| r.activated("other"), Record::replaced];
    for by_hand in by_hand {
        for mut record in [Record::default(), offered(), taught()] {
            by_hand(&mut record);
            record.gather(true, session(7, 100.0));
            assert_eq!((record.due(true, None), record.by_itself()), (None, false));
        }
    }
}

#[test]
fn no_more_is_kept_than_one_calibration_takes() {
    let mut record = Record::default();
    for id in 0..40 {
        record.gather(false, session(id, 1.0));
    }
    assert_eq!(record.motion(None).x, Some(40.0), "what is too old still counts");
    assert_eq!(record.sessions.len(), MAX_SESSIONS);
    let long = |id| Teaching { n_samples: MAX_SAMPLES as i64, ..session(id, 100.0) };
    record.gather(false, long(40));
    assert_eq!(ids(&record.due(false, None).unwrap()), ["40"]);
    record.gather(false, session(41, 100.0));
    assert_eq!(ids(&record.due(false, None).unwrap()), ["41"]);
}

#[test]
fn a_deleted_session_does_not_teach() {
    let mut record = Record::default();
    record.gather(false, session(1, 80.0));
    assert!(!record.forget("2", false));
    assert!(record.forget("1", false));
    assert_eq!(record, Record::default());
}

#[test]
fn the_record_is_kept_as_a_document() {
    for record in [Record::default(), offered(), taught()] {
        let document = serde_json::to_string(&record).unwrap();
        assert_eq!(serde_json::from_str::<Record>(&document).unwrap(), record);
    }
}
