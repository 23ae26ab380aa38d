use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use offbd_core::vocabulary::any_sample;

const LIMIT: usize = 100;

fn csv(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    TelemetryFormat::Csv.parse(document, limit)
}

fn reasons(batch: &Batch) -> Vec<(usize, &str)> {
    let reason = |(i, row): (usize, &'static Result<Sample, String>)| {
        row.as_ref().err().map(|reason| (i, reason.as_str()))
    };
    let rows: &'static [Result<Sample, String>] = Box::leak(batch.rows.clone().into_boxed_slice());
    rows.iter().enumerate().filter_map(reason).collect()
}

#[test]
fn rows_and_columns_are_equivalent() {
    let rows = br#"{"session":"a","id":7,"samples":[
        {"seq":1,"t_s":0.5,"cmd_qx_rad":0.1,"x_m":null,"note":[1,{}]},{"t_s":1,"y_m":-2}]}"#;
    let columns = br#"{"session":"a","id":"7","t_s":[0.5,1],"seq":[1,null],
        "cmd_qx_rad":[0.1,null],"y_m":[null,-2]}"#;
    let mut batch = json(rows, LIMIT).unwrap();
    assert_eq!(batch.unknown, [UnknownKeyView { key: "note".to_owned(), meant: None }]);
    batch.unknown.clear();
    assert_eq!(batch, json(columns, LIMIT).unwrap());
    assert_eq!(batch.id.as_deref(), Some("7"));
    let first = Sample { seq: Some(1), t_s: 0.5, cmd_qx_rad: Some(0.1), ..Sample::default() };
    assert_eq!(batch.rows[0], Ok(first));
    assert_eq!(batch.rows[1], Ok(Sample { t_s: 1.0, y_m: Some(-2.0), ..Sample::default() }));
}

#[test]
fn an_invalid_row_is_reported_and_the_others_are_accepted() {
    let document = br#"{"samples":[{"t_s":0},{"t_s":"1"},{"t_s":null},{},3,{"t_s":1,"x_m":[]},
        {"t_s":2,"seq":-1},{"t_s":2,"seq":1.5},{"t_s":2,"seq":18446744073709551615},null,{"t_s":9}]}"#;
    let batch = json(document, LIMIT).unwrap();
    let wanted = [
        (1, "`t_s` is a string, not a number"),
        (2, "`t_s` is null"),
        (3, "`t_s` is missing"),
        (4, "the row is a number, not an object"),
        (5, "`x_m` is an array, not a number"),
        (6, "`seq` is -1, not a whole number from 0"),
        (7, "`seq` is 1.5, not a whole number from 0"),
        (8, "`seq` is 18446744073709551615, beyond 9223372036854775807"),
        (9, "the row is null, not an object"),
    ];
    assert_eq!(reasons(&batch), wanted);
}

#[test]
fn keys_that_are_not_understood_are_named_with_those_that_are_meant() {
    let rows =
        br#"{"samples":[{"t_s":0,"cmd_qx":0.1,"x":0.2,"y":0.3},{"t_s":1},{"t_s":2,"x_m":0.1}]}"#;
    let columns = br#"{"t_s":[0,1],"cmd_qx":[0,0],"x":[0,0],"y":[1,1],"samples_":3}"#;
    let lines = b"{\"t_s\":0,\"x\":1}\n{\"t_s\":1,\"x_m\":1}\n";
    let reason = "has none of the keys cmd_qx_rad, cmd_qy_rad, x_m, y_m";
    let meant = |batch: &Batch| -> Vec<(String, Option<String>)> {
        batch.unknown.iter().map(|key| (key.key.clone(), key.meant.clone())).collect()
    };
    let pair = |key: &str, meant: &str| (key.to_owned(), Some(meant.to_owned()));
    let batch = json(rows, LIMIT).unwrap();
    assert_eq!(meant(&batch), [pair("cmd_qx", "cmd_qx_rad"), pair("x", "x_m"), pair("y", "y_m")]);
    assert_eq!(reasons(&batch), [(0, reason), (1, reason)]);
    let batch = json(columns, LIMIT).unwrap();
    assert_eq!(
        meant(&batch)[..3],
        [pair("cmd_qx", "cmd_qx_rad"), pair("x", "x_m"), pair("y", "y_m")]
    );
    assert_eq!(reasons(&batch), [(0, reason), (1, reason)]);
    let batch = ndjson(lines, LIMIT).unwrap();
    assert_eq!((meant(&batch), reasons(&batch)), (vec![pair("x", "x_m")], vec![(0, reason)]));
    let many: Vec<String> = (0..100).map(|i| format!("\"{}{i}\":1", "k".repeat(90))).collect();
    let batch =
        json(format!("{{\"samples\":[{{\"t_s\":0,{}}}]}}", many.join(",")).as_bytes(), LIMIT);
    let unknown = batch.unwrap().unknown;
    assert!(unknown.len() <= 8 && unknown.iter().all(|key| key.key.len() <= 64), "{unknown:?}");
}

#[test]
fn a_non_finite_number_in_json_invalidates_only_its_row() {
    let document = br#"{"session":"NaN \" NaN","samples":[{"t_s":0,"x_m":NaN},{"t_s":1},
        {"t_s":-Infinity},{"t_s":2,"y_m":1e999}]}"#;
    let batch = json(document, LIMIT).unwrap();
    assert_eq!(batch.session.as_deref(), Some("NaN \" NaN"));
    let wanted = [
        (0, "`x_m` is not finite, not a number"),
        (2, "`t_s` is not finite, not a number"),
        (3, "`y_m` is not finite, not a number"),
    ];
    assert_eq!(reasons(&batch), wanted);
    let lines =
        ndjson(b"{\"t_s\":0}\n\n{\"t_s\":NaN}\n{\"t_s\":\n[]\n{\"t_s\":4}\r\n", LIMIT).unwrap();
    assert_eq!(reasons(&lines).iter().map(|r| r.0).collect::<Vec<_>>(), [1, 2, 3]);
}

#[test]
fn a_malformed_document_is_rejected_with_the_pointer_of_the_error() {
    let refused = |document: &str| match json(document.as_bytes(), LIMIT) {
        Err(BatchError::Malformed { pointer, reason }) => (pointer, reason),
        other => panic!("{document}: {other:?}"),
    };
    let (pointer, reason) = refused(r#"{"samples":[{"t_s":0}"#);
    assert_eq!(pointer, "/samples");
    assert!(reason.contains("line 1"), "{reason}");
    assert_eq!(refused(r#"{"samples":3}"#).0, "/samples");
    assert_eq!(refused(r#"{"session":3,"samples":[]}"#).0, "/session");
    assert_eq!(refused(r#"{"t_s":[1,2],"x_m":[1]}"#).0, "/x_m");
    assert_eq!(refused(r#"{"x_m":[1]}"#).0, "/t_s");
    assert_eq!(refused("[]").0, "");
    assert_eq!(refused("{}").0, "/t_s");
    assert_eq!(refused(r#"{"samples":[],"t_s":[]}"#).0, "/samples");
    assert!(refused(r#"{"samples":[]} x"#).1.contains("not valid JSON at line 1, column"));
    assert!(refused("").1.contains("is empty"));
}

#[test]
fn a_batch_with_too_many_rows_is_rejected_as_a_whole() {
    let rows: Vec<_> = (0..=LIMIT).map(|i| format!(r#"{{"t_s":{i}}}"#)).collect();
    let too_many = BatchError::TooMany { found: LIMIT + 1, limit: LIMIT };
    let document = format!(r#"{{"samples":[{}]}}"#, rows.join(","));
    assert_eq!(json(document.as_bytes(), LIMIT), Err(too_many.clone()));
    assert_eq!(ndjson(rows.join("\n").as_bytes(), LIMIT), Err(too_many));
    let header = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n";
    let csv_rows = "0,,,,\n".repeat(LIMIT + 1);
    assert!(csv(format!("{header}{csv_rows}").as_bytes(), LIMIT).is_err());
}

#[test]
fn the_valid_rows_of_a_csv_batch_are_accepted() {
    let text = b"t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,0,0\nx,0,0,0,0\n2,,,,\n";
    let batch = csv(text, LIMIT).unwrap();
    let time = "line 3: `t_s`: `x` is not a number; a time is in seconds, or as 2026-02-20 13:51:00.25 in all rows";
    assert_eq!(reasons(&batch), [(1, time)]);
    assert_eq!(batch.rows.len(), 3);
    assert_eq!(batch.unknown, []);
}

#[test]
fn columns_of_csv_that_are_not_read_are_named() {
    let text = b"t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m,x,note\n0,0,0,0,0,1,a\n";
    let unknown = csv(text, LIMIT).unwrap().unknown;
    let named: Vec<_> = unknown.iter().map(|k| (k.key.as_str(), k.meant.as_deref())).collect();
    assert_eq!(named, [("x", Some("x_m")), ("note", None)]);
}

fn finite() -> impl Strategy<Value = f64> {
    proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO
}

fn sample() -> impl Strategy<Value = Sample> {
    any_sample(0..=MAX_SEQ, finite)
}

proptest! {
    #[test]
    fn every_format_preserves_samples_bit_for_bit(samples in proptest::collection::vec(sample(), 0..LIMIT)) {
        let views: Vec<_> = samples.iter().map(sample_view).collect();
        let wanted: Vec<String> = samples.iter().map(|s| format!("{:?}", Ok::<_, String>(s))).collect();
        let rows_of = |batch: Batch| batch.rows.iter().map(|r| format!("{r:?}")).collect::<Vec<_>>();
        let rows = serde_json::to_vec(&RowsView { session: None, samples: views.clone() }).unwrap();
        prop_assert_eq!(&rows_of(json(&rows, LIMIT).unwrap()), &wanted);
        let lines: Vec<_> = views.iter().map(|v| serde_json::to_string(v).unwrap()).collect();
        prop_assert_eq!(&rows_of(ndjson(lines.join("\n").as_bytes(), LIMIT).unwrap()), &wanted);
        let packed = rmp_serde::to_vec_named(&RowsView { session: None, samples: views }).unwrap();
        prop_assert_eq!(&rows_of(msgpack(&packed, LIMIT).unwrap()), &wanted);
        let mut text = Vec::new();
        crate::session_csv::write(&mut text, &samples).unwrap();
        prop_assert_eq!(&rows_of(csv(&text, LIMIT).unwrap()), &wanted);
    }

    #[test]
    fn arbitrary_bytes_are_parsed_or_rejected_without_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let _ = json(&bytes, LIMIT);
        let _ = msgpack(&bytes, LIMIT);
        let _ = ndjson(&bytes, LIMIT);
        let _ = csv(&bytes, LIMIT);
    }

    #[test]
    fn arbitrary_json_like_text_is_parsed_or_rejected_without_panic(text in r#"[\{\}\[\]:,"a-z_0-9.eE+\- ]{0,80}"#) {
        let _ = json(text.as_bytes(), LIMIT);
    }

    /// Both formats give the same rows with the same reasons, or are rejected with the same
    /// pointer.
    #[test]
    fn a_document_gives_the_same_result_in_msgpack_and_json(document in document()) {
        let outcome = |batch: Result<Batch, BatchError>| batch.map_err(|error| match error {
            BatchError::Malformed { pointer, .. } => Err(pointer),
            BatchError::TooMany { found, limit } => Ok((found, limit)),
        });
        let packed = rmp_serde::to_vec_named(&document).unwrap();
        let text = serde_json::to_vec(&document).unwrap();
        prop_assert_eq!(outcome(msgpack(&packed, LIMIT)), outcome(json(&text, LIMIT)));
    }

    #[test]
    fn truncated_msgpack_is_rejected_and_altered_msgpack_does_not_panic(
        document in document(),
        cut in any::<prop::sample::Index>(),
        change in any::<(prop::sample::Index, u8)>(),
    ) {
        let packed = rmp_serde::to_vec_named(&document).unwrap();
        let whole = msgpack(&packed, LIMIT);
        let cut = &packed[..cut.index(packed.len())];
        prop_assert!(msgpack(cut, LIMIT).is_err());
        let mut longer = packed.clone();
        longer.push(0xc0);
        prop_assert!(msgpack(&longer, LIMIT).is_err() || whole.is_err());
        let mut altered = packed;
        let at = change.0.index(altered.len());
        altered[at] = change.1;
        let _ = msgpack(&altered, LIMIT);
    }
}

/// Values in place of a number.
fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        4 => finite().prop_map(|v| json!(v)),
        2 => any::<i64>().prop_map(|v| json!(v)),
        1 => any::<u64>().prop_map(|v| json!(v)),
        1 => Just(Value::Null),
        1 => any::<bool>().prop_map(|v| json!(v)),
        1 => "[a-z\u{e9}\u{1}]{0,40}".prop_map(|v| json!(v)),
        1 => Just(json!([1, [2]])),
        1 => Just(json!({ "t_s": { "x": 1 } })),
    ]
}

const FIELDS: &str = "t_s|seq|cmd_qx_rad|cmd_qy_rad|x_m|y_m|note";

fn row() -> impl Strategy<Value = Value> {
    let object = proptest::collection::btree_map(FIELDS, value(), 0..7)
        .prop_map(|fields| Value::Object(fields.into_iter().collect()));
    prop_oneof![8 => object, 1 => value()]
}

/// Objects that may be batches.
fn document() -> impl Strategy<Value = Value> {
    let rows = proptest::collection::vec(row(), 0..LIMIT + 20);
    let rows = (rows, value()).prop_map(|(rows, id)| json!({ "samples": rows, "id": id }));
    let column = |n| proptest::collection::vec(value(), n).prop_map(Value::from);
    let columns = (0..LIMIT + 20).prop_flat_map(move |n| {
        proptest::collection::btree_map(FIELDS, column(n), 1..7)
            .prop_map(|columns| Value::Object(columns.into_iter().collect()))
    });
    let fields = "session|id|samples|t_s|x_m|note";
    let odd = proptest::collection::btree_map(fields, prop_oneof![value(), column(3)], 0..5)
        .prop_map(|fields| Value::Object(fields.into_iter().collect()));
    prop_oneof![rows, columns, odd]
}

/// Returns pointer and reason of the error for a MessagePack document.
fn refused(document: &[u8]) -> (String, String) {
    match msgpack(document, LIMIT) {
        Err(BatchError::Malformed { pointer, reason }) => (pointer, reason),
        other => panic!("{document:x?}: {other:?}"),
    }
}

#[test]
fn a_msgpack_value_without_json_equivalent_invalidates_only_its_row() {
    let column = |values: &[&[u8]]| {
        let mut document = vec![0x81, 0xa3, b't', b'_', b's', 0x90 | values.len() as u8];
        values.iter().for_each(|value| document.extend_from_slice(value));
        document
    };
    let (nan, half) = (0x7fc0_0000_u32.to_be_bytes(), 0.5_f32.to_be_bytes());
    let f32 = |v: [u8; 4]| [0xca, v[0], v[1], v[2], v[3]];
    let document = column(&[
        &f32(nan),
        &f32(half),
        &[0xc4, 2, 1, 2],    // bytes
        &[0xd4, 5, 0],       // an extension
        &[0xa2, 0xff, 0xfe], // a string that is not UTF-8
        &[0xd3, 0x80, 0, 0, 0, 0, 0, 0, 0],
    ]);
    let batch = msgpack(&document, LIMIT).unwrap();
    let wanted = [
        (0, "`t_s` is not finite, not a number"),
        (2, "`t_s` is bytes, not a number"),
        (3, "`t_s` is an extension, not a number"),
        (4, "`t_s` is bytes, not a number"),
    ];
    assert_eq!(reasons(&batch), wanted);
    assert_eq!(batch.rows[1], Ok(Sample { t_s: 0.5, ..Sample::default() }));
    assert_eq!(batch.rows[5], Ok(Sample { t_s: i64::MIN as f64, ..Sample::default() }));
}

#[test]
fn hostile_msgpack_is_rejected_with_the_pointer_of_the_error() {
    for document in [&[][..], &[0x90], &[0xc1], &[0xdf, 0xff, 0xff, 0xff, 0xff]] {
        assert_eq!(refused(document).0, "", "{document:x?}");
    }
    let key = |name: &str, value: &[u8]| {
        [&[0x81, 0xa0 | name.len() as u8], name.as_bytes(), value].concat()
    };
    let huge = [0xff; 4];
    for (name, marker, pointer) in [
        ("samples", 0xdd, "/samples/0"),
        ("x_m", 0xdd, "/x_m/0"),
        ("session", 0xdb, "/session"),
        ("note", 0xc6, "/note"),
    ] {
        let document = key(name, &[&[marker][..], &huge].concat());
        assert_eq!(refused(&document).0, pointer);
    }
    let deep = [vec![0x91; 100_000], vec![0xc0]].concat();
    for name in ["note", "samples", "t_s"] {
        assert!(refused(&key(name, &deep)).1.contains("depth"), "{name}");
    }
    assert_eq!(refused(&[0x81, 0x07, 0xc0]).0, "/7", "a key that is not a string");
    assert!(refused(&[0x80, 0xc0]).1.contains("1 bytes follow"));
}

#[test]
fn a_row_with_a_key_twice_is_invalid() {
    let document = br#"{"samples":[{"t_s":0,"x_m":0.1,"x_m":0.2},{"t_s":1,"t_s":null},
        {"t_s":2,"x_m":0.3,"other":1,"other":2}]}"#;
    let rows = json(document, 9).unwrap().rows;
    assert_eq!(rows[0], Err("has the key `x_m` twice".to_owned()));
    assert_eq!(rows[1], Err("has the key `t_s` twice".to_owned()));
    assert_eq!(rows[2].as_ref().map(|sample| sample.x_m), Ok(Some(0.3)));
}
