use offbd_wire::telemetry::RowView;

use super::*;

/// A batch of CSV with `n` valid rows and one that is not a sample.
fn batch(n: usize) -> NewBatch {
    let rows: String = (0..n).map(|i| format!("{i},0.01,0.02,0.1,0.0\n")).collect();
    let body =
        format!("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n{rows}{n},a,0.02,0.1,0.0\n").into_bytes();
    let (query, media_type) = ("session=s".to_owned(), "text/csv".to_owned());
    NewBatch { asset: "rig".to_owned(), query, media_type, body }
}

fn ack(accepted: usize, duplicate: usize, rejected: &[usize]) -> AckView {
    let row = |&index: &usize| RowView { index, reason: format!("reason {}", index % 2) };
    let rejected = rejected.iter().map(row).collect();
    AckView { accepted, duplicate, rejected, ..AckView::default() }
}

fn told(ack: &AckView) -> Attempt {
    meaning(StatusCode::OK, &serde_json::to_vec(ack).unwrap(), &batch(3))
}

fn problem(status: u16, kind: &str, said: u16) -> Attempt {
    let answer = format!(r#"{{"type": "{kind}", "status": {said}, "detail": "because"}}"#);
    meaning(StatusCode::from_u16(status).unwrap(), answer.as_bytes(), &batch(3))
}

/// Each row has to be told of once: the row that is not a sample as well, which the agent has
/// named to the device itself.
#[test]
fn only_an_acknowledgement_of_every_row_ends_a_batch() {
    assert!(matches!(told(&ack(3, 0, &[3])), Attempt::Stored));
    assert!(matches!(told(&ack(1, 2, &[3])), Attempt::Stored));
    let others = [
        ack(2, 0, &[3]),
        ack(4, 0, &[3]),
        ack(3, 1, &[3]),
        ack(4, 0, &[4]),
        ack(3, 0, &[4]),
        ack(2, 0, &[3, 3]),
        ack(usize::MAX, 1, &[3]),
        ack(usize::MAX, 0, &[0, 1, 2, 3]),
    ];
    for other in &others {
        let Attempt::Failed(failure) = told(other) else { panic!("{other:?}") };
        assert_eq!(failure.cause, "200 OK, but not an acknowledgement of the 4 rows sent");
        assert_eq!(failure.wait, None);
    }
    let page = meaning(StatusCode::OK, b"<html>Log in to the network", &batch(3));
    let Attempt::Failed(failure) = page else { panic!("a page is not an answer of the service") };
    assert_eq!(failure.cause, "200 OK, but not an acknowledgement");
    assert_eq!(failure.answer, "<html>Log in to the network");
}

#[test]
fn samples_that_the_service_rejects_are_kept_with_their_reasons() {
    let Attempt::Rejected { samples, reason } = told(&ack(1, 0, &[0, 2, 3])) else { panic!() };
    assert_eq!(reason, "2 of 4 rows rejected: row 0 and 1 more: reason 0");
    let kept = parsed(&samples).unwrap();
    let times: Vec<f64> = kept.rows.iter().map(|row| row.as_ref().unwrap().t_s).collect();
    assert_eq!(times, [0.0, 2.0]);
    assert_eq!((samples.asset.as_str(), samples.query.as_str()), ("rig", "session=s"));
    let in_session = AckView { session: Some("s1".to_owned()), ..ack(1, 0, &[0, 2, 3]) };
    let Attempt::Rejected { samples, .. } = told(&in_session) else { panic!() };
    assert_eq!(parsed(&samples).unwrap().session.as_deref(), Some("s1"));
    assert_eq!(samples.query, "", "the session is in the body");
}

/// Only what the service would refuse again is final, and only if it is the service that says so.
#[test]
fn only_a_refusal_by_the_service_itself_is_final() {
    let ours = format!("{PROBLEM_TYPE}x");
    for status in [400, 409, 413, 415, 422] {
        let Attempt::Refused(reason) = problem(status, &ours, status) else { panic!("{status}") };
        assert!(reason.starts_with(&status.to_string()) && reason.contains("because"), "{reason}");
        for (kind, said) in [("about:blank", status), (ours.as_str(), 500)] {
            let Attempt::Failed(failure) = problem(status, kind, said) else { panic!("{status}") };
            assert!(failure.cause.ends_with(", not from the service"), "{}", failure.cause);
        }
    }
    for status in [201, 204, 301, 401, 403, 404, 408, 421, 429, 500, 502, 503, 504] {
        let Attempt::Failed(failure) = problem(status, &ours, status) else { panic!("{status}") };
        assert!(failure.cause.ends_with(&format!(": {ours}")), "{}", failure.cause);
    }
}

#[test]
fn a_long_reason_is_cut_between_characters() {
    assert_eq!(shortened(&"a".repeat(MAX_REASON_BYTES)), "a".repeat(MAX_REASON_BYTES));
    let long = format!("a{}", "é".repeat(MAX_REASON_BYTES));
    let cut = shortened(&long);
    assert_eq!(cut, format!("a{}…", "é".repeat(MAX_REASON_BYTES / 2 - 1)));
}
