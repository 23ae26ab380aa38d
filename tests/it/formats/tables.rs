//! Session files as tables: what is written is read back, what others write is read, and what
//! is damaged is refused.

use std::io::Cursor;

use offbd::wire::session_file::{SessionFileError, SessionFormat, SessionRowError, open};
use offbd::wire::table::TableOptions;
use offbd_core::vocabulary::Sample;

const CSV_FILE: &[u8] =
    b"seq,t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0.1,,0.25,-0.5\n1,0.01,-0.1,0.2,,\n";

fn rows(file: &[u8]) -> Result<Vec<Result<Sample, String>>, SessionFileError> {
    rows_by(file, &TableOptions::default())
}

fn rows_by(
    file: &[u8],
    options: &TableOptions,
) -> Result<Vec<Result<Sample, String>>, SessionFileError> {
    let mut samples = Vec::new();
    for row in open(Cursor::new(file.to_vec()), None, options)? {
        match row {
            Ok(sample) => samples.push(Ok(sample)),
            Err(SessionRowError::Rejected(row)) => samples.push(Err(row.to_string())),
            Err(SessionRowError::Unreadable(error)) => return Err(error),
        }
    }
    Ok(samples)
}

fn samples(file: &[u8]) -> Vec<Sample> {
    rows(file).unwrap().into_iter().map(Result::unwrap).collect()
}

#[test]
fn a_file_is_csv_unless_its_first_bytes_say_otherwise() {
    assert_eq!(SessionFormat::of(b"PAR1"), SessionFormat::Parquet);
    assert_eq!(SessionFormat::of(b"ARROW1\0\0"), SessionFormat::Arrow);
    assert_eq!(SessionFormat::of(b"\xff\xff\xff\xff\x10"), SessionFormat::Arrow);
    assert_eq!(SessionFormat::of(b"\x89MCAP0\r\n"), SessionFormat::Mcap);
    for csv in [&b"t_s,x_m"[..], b"", b"PA"] {
        assert_eq!(SessionFormat::of(csv), SessionFormat::Csv);
    }
    assert_eq!(samples(CSV_FILE).len(), 2);
}

#[cfg(not(feature = "parquet"))]
#[test]
fn a_format_that_is_not_built_is_refused_with_the_feature_that_it_needs() {
    let Err(error) = rows(b"PAR1") else { panic!("read") };
    assert!(error.to_string().contains("--features parquet"), "{error}");
}

#[cfg(feature = "parquet")]
mod columns {
    use super::*;
    use arrow_array::cast::AsArray;
    use arrow_array::types::{Float32Type, Int32Type, TimestampMicrosecondType, UInt8Type};
    use arrow_array::{
        ArrayRef, BooleanArray, Decimal128Array, Float64Array, NullArray, PrimitiveArray,
        RecordBatch, StringArray, TimestampMicrosecondArray,
    };
    use offbd::wire::session_file::{SessionInfo, SessionWriter};
    use proptest::prelude::*;
    use std::sync::Arc;

    const FORMATS: &[SessionFormat] = if cfg!(feature = "mcap") {
        &[SessionFormat::Parquet, SessionFormat::Arrow, SessionFormat::Mcap]
    } else {
        &[SessionFormat::Parquet, SessionFormat::Arrow]
    };

    fn write(format: SessionFormat, samples: &[Sample], at_a_time: usize) -> Vec<u8> {
        write_with(&SessionInfo::default(), format, samples, at_a_time)
    }

    fn write_with(
        info: &SessionInfo,
        format: SessionFormat,
        samples: &[Sample],
        at_a_time: usize,
    ) -> Vec<u8> {
        let (mut writer, mut file) = SessionWriter::new(format, info, true).unwrap();
        for samples in samples.chunks(at_a_time) {
            file.extend(writer.rows(samples).unwrap());
        }
        file.extend(writer.end().unwrap());
        file
    }

    /// The absolute times in an Arrow stream, µs since 1970, and their type; `None` without them.
    fn times(file: Vec<u8>) -> Option<(Vec<Option<i64>>, String)> {
        let batches = arrow_ipc::reader::StreamReader::try_new(Cursor::new(file), None).unwrap();
        let data_type = batches.schema().field_with_name("time").ok()?.data_type().to_string();
        let mut times = Vec::new();
        for batch in batches {
            let column = batch.unwrap().column_by_name("time").unwrap().clone();
            times.extend(column.as_primitive::<TimestampMicrosecondType>());
        }
        Some((times, data_type))
    }

    #[test]
    fn a_clock_that_counts_from_1970_gives_absolute_times_that_are_not_read_back() {
        let seconds = [1.7e9 + 0.25, 1.7e9 + 0.26, 12.0, 1e12];
        let sample = |t_s| Sample { t_s, x_m: Some(0.1), ..Sample::default() };
        let session = seconds.map(sample);
        for &format in FORMATS {
            let info = SessionInfo { first_t_s: Some(seconds[0]), ..SessionInfo::default() };
            assert_eq!(samples(&write_with(&info, format, &session, 3)), session, "{format}");
        }
        let arrow = |first_t_s| {
            let info = SessionInfo { first_t_s, ..SessionInfo::default() };
            times(write_with(&info, SessionFormat::Arrow, &session, 3))
        };
        let micros = vec![Some(1_700_000_000_250_000), Some(1_700_000_000_260_000), None, None];
        let (found, data_type) = arrow(Some(seconds[0])).unwrap();
        assert_eq!((found, &*data_type), (micros, "Timestamp(µs, \"UTC\")"));
        for other in [None, Some(0.0), Some(9.4e8), Some(4.2e9), Some(f64::NAN)] {
            assert_eq!(arrow(other), None, "{other:?}");
        }
    }

    /// An Arrow stream of other columns than those of offbd.
    fn stream(columns: Vec<(&str, ArrayRef)>) -> Vec<u8> {
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let mut writer =
            arrow_ipc::writer::StreamWriter::try_new(Vec::new(), &batch.schema()).unwrap();
        writer.write(&batch).unwrap();
        writer.finish().unwrap();
        writer.into_inner().unwrap()
    }

    fn doubles(values: [f64; 3]) -> ArrayRef {
        Arc::new(Float64Array::from(values.to_vec()))
    }

    fn with(column: &'static str, values: ArrayRef) -> Vec<u8> {
        let mut columns = vec![
            ("t_s", doubles([0.0, 1.0, 2.0])),
            ("cmd_qx_rad", doubles([0.1; 3])),
            ("cmd_qy_rad", doubles([0.2; 3])),
            ("x_m", doubles([0.3; 3])),
            ("y_m", doubles([0.4; 3])),
        ];
        columns.retain(|(name, _)| *name != column);
        columns.push((column, values));
        stream(columns)
    }

    #[test]
    fn a_session_without_samples_is_a_file_without_rows() {
        for &format in FORMATS {
            assert_eq!(samples(&write(format, &[], 1)), [], "{format}");
        }
    }

    #[test]
    fn what_was_written_by_earlier_versions_and_other_programs_is_read() {
        let expected = samples(CSV_FILE);
        for file in [
            &include_bytes!("../../formats/offbd.parquet")[..],
            include_bytes!("../../formats/offbd.arrow"),
            include_bytes!("../../formats/pandas.parquet"),
            include_bytes!("../../formats/polars.parquet"),
            include_bytes!("../../formats/polars.arrow"),
            include_bytes!("../../formats/pyarrow-file.arrow"),
            include_bytes!("../../formats/duckdb.parquet"),
        ] {
            assert_eq!(samples(file), expected);
        }
    }

    #[test]
    fn other_numeric_types_are_converted() {
        let single: ArrayRef = Arc::new(PrimitiveArray::<Float32Type>::from(vec![0.5, 0.25, -1.0]));
        let x: Vec<_> = samples(&with("x_m", single)).iter().map(|s| s.x_m).collect();
        assert_eq!(x, [Some(0.5), Some(0.25), Some(-1.0)]);
        let whole: ArrayRef = Arc::new(PrimitiveArray::<Int32Type>::from(vec![3, 4, 5]));
        let t_s: Vec<_> = samples(&with("t_s", whole)).iter().map(|s| s.t_s).collect();
        assert_eq!(t_s, [3.0, 4.0, 5.0]);
        let small: ArrayRef = Arc::new(PrimitiveArray::<UInt8Type>::from(vec![7, 8, 9]));
        let seq: Vec<_> = samples(&with("seq", small)).iter().map(|s| s.seq).collect();
        assert_eq!(seq, [Some(7), Some(8), Some(9)]);
        let seq: Vec<_> =
            samples(&with("seq", doubles([1.0, f64::NAN, 3.0]))).iter().map(|s| s.seq).collect();
        assert_eq!(seq, [Some(1), None, Some(3)]);
        let none: ArrayRef = Arc::new(NullArray::new(3));
        assert!(samples(&with("y_m", none)).iter().all(|s| s.y_m.is_none()));
    }

    #[test]
    fn nan_is_a_missing_value_and_an_infinite_one_is_rejected_with_its_row() {
        let found = rows(&with("x_m", doubles([f64::NAN, f64::INFINITY, 1.0]))).unwrap();
        assert_eq!(found[0].as_ref().unwrap().x_m, None);
        assert_eq!(found[1].as_ref().unwrap_err(), "row 2: `x_m`: `inf` is not finite");
        assert_eq!(found[2].as_ref().unwrap().x_m, Some(1.0));
        let found = rows(&with("t_s", doubles([0.0, f64::NAN, 2.0]))).unwrap();
        assert_eq!(found[1].as_ref().unwrap_err(), "row 2: `t_s` is empty");
        let found = rows(&with("seq", doubles([0.5, -1.0, 1e300]))).unwrap();
        assert!(found.iter().all(|row| row.as_ref().unwrap_err().contains("`seq`")), "{found:?}");
    }

    #[test]
    fn a_column_of_another_type_a_missing_and_a_double_one_are_named() {
        let truth: ArrayRef = Arc::new(BooleanArray::from(vec![true, false, true]));
        let error = rows(&with("cmd_qy_rad", truth)).unwrap_err().to_string();
        assert_eq!(error, "the column `cmd_qy_rad` has the type Boolean, not a number");
        let error = rows(&stream(vec![("t_s", doubles([0.0; 3]))])).unwrap_err().to_string();
        assert!(error.contains("lacks the column `cmd_qx_rad`; it has `t_s`"), "{error}");
        let columns = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m", "x_m"];
        let twice = columns.map(|name| (name, doubles([0.0; 3]))).to_vec();
        let error = rows(&stream(twice)).unwrap_err().to_string();
        assert!(error.contains("names the column `x_m` twice"), "{error}");
    }

    #[test]
    fn dates_text_and_decimals_are_read_as_from_a_text() {
        let times: ArrayRef = Arc::new(
            TimestampMicrosecondArray::from(vec![1_771_595_460_250_000, 1_771_595_461_000_000])
                .with_timezone("UTC"),
        );
        let x: ArrayRef = Arc::new(StringArray::from(vec!["12,5", "12.5"]));
        let decimals = Decimal128Array::from(vec![-125, 250]).with_precision_and_scale(9, 4);
        let y: ArrayRef = Arc::new(decimals.unwrap());
        let command: ArrayRef = Arc::new(Float64Array::from(vec![0.1, 0.2]));
        let columns = vec![("when", times), ("q", command), ("ball x", x), ("ball y", y)];
        let options = TableOptions {
            columns: "t_s=when, cmd_qy_rad=q, cmd_qx_rad=q, x_m='ball x'/mm, y_m='ball y'"
                .parse()
                .unwrap(),
            ..TableOptions::default()
        };
        let found = rows_by(&stream(columns), &options).unwrap();
        assert_eq!(found[0].as_ref().unwrap_err(), "row 1: `x_m`: `12,5` is not a number");
        let second = found[1].as_ref().unwrap();
        assert_eq!(
            (second.t_s, second.x_m, second.y_m),
            (1_771_595_461.0, Some(0.0125), Some(0.025))
        );
    }

    #[test]
    fn columns_of_other_names_are_answered_with_a_mapping() {
        let names = ["time", "roll_deg", "pitch_deg", "bx", "by"];
        let columns = names.map(|name| (name, doubles([0.0, 10.0, 20.0]))).to_vec();
        let error = rows(&stream(columns)).unwrap_err().to_string();
        for part in ["it has `time`, `roll_deg`", "t_s=time/ms, cmd_qx_rad=roll_deg/deg"] {
            assert!(error.contains(part), "{error}");
        }
    }

    /// Samples of which a file has several pages and batches.
    fn many() -> Vec<Sample> {
        let sample = |i: u32| Sample {
            seq: Some(u64::from(i)),
            t_s: f64::from(i) * 0.01,
            cmd_qx_rad: Some(f64::from(i % 7) * 0.01),
            cmd_qy_rad: (!i.is_multiple_of(3)).then(|| f64::from(i % 11)),
            x_m: (!i.is_multiple_of(5)).then(|| f64::from(i).sin()),
            y_m: None,
        };
        (0..20_000).map(sample).collect()
    }

    #[test]
    fn of_a_file_that_ends_too_early_the_reason_is_known_and_no_end_is_reached() {
        for &format in FORMATS {
            let file = write(format, &many()[..5000], 2048);
            for n in (9..file.len()).step_by(file.len() / 97).chain([file.len() - 1]) {
                let error = rows(&file[..n]).unwrap_err();
                assert!(
                    matches!(error, SessionFileError::Damaged { .. }),
                    "{format}, {n} of {} bytes: {error}",
                    file.len()
                );
            }
        }
    }

    #[test]
    fn no_wrong_byte_stops_the_program() {
        for &format in FORMATS {
            let file = write(format, &many()[..600], 200);
            // More of the end, where the structure of a Parquet file is.
            let (start, end) = (file.len() / 2, file.len() - 1200);
            let places = (0..start).step_by(97).chain((start..end).step_by(331));
            for at in places.chain((end..file.len()).step_by(13)) {
                for flip in [0x01, 0xff] {
                    let mut damaged = file.clone();
                    damaged[at] ^= flip;
                    let _ = rows(&damaged);
                }
            }
        }
    }

    fn finite() -> impl Strategy<Value = f64> {
        proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO
    }

    proptest! {
        #[test]
        fn written_samples_are_read_back_bit_for_bit(
            rows in proptest::collection::vec(
                (
                    proptest::option::of(0..u64::MAX / 2),
                    finite(),
                    proptest::array::uniform4(proptest::option::of(finite())),
                ),
                0..50,
            ),
            at_a_time in 1..20_usize,
        ) {
            // Large times are those of another unit, and a time that falls is that of another run.
            let in_seconds = |t_s: f64| if t_s.abs() < 1e11 { t_s } else { t_s.recip() };
            let mut expected: Vec<Sample> = rows.into_iter().map(|(seq, t_s, [a, b, c, d])| Sample {
                seq, t_s: in_seconds(t_s), cmd_qx_rad: a, cmd_qy_rad: b, x_m: c, y_m: d,
            }).collect();
            expected.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
            for &format in FORMATS {
                let back = samples(&write(format, &expected, at_a_time));
                prop_assert_eq!(format!("{:?}", back), format!("{:?}", expected));
            }
        }
    }
}

#[cfg(feature = "mcap")]
mod mcap_files {
    use super::*;
    use std::collections::BTreeMap;

    use foxglove::Decode;
    use foxglove::messages::{FrameTransforms, Log, SceneUpdate, log};
    use mcap::records::MessageHeader;
    use mcap::{MessageStream, WriteOptions};
    use nalgebra::{Quaternion, UnitQuaternion, Vector3};
    use offbd::wire::asset;
    use offbd::wire::session_file::{SessionInfo, SessionWriter};
    use offbd_core::engine::Rig;

    /// A file of one topic with the given messages.
    fn file(schema: &str, encoding: &str, messages: &[&str]) -> Vec<u8> {
        let mut writer = WriteOptions::new().create(Cursor::new(Vec::new())).unwrap();
        let schema = writer.add_schema(schema, "jsonschema", b"{}").unwrap();
        let channel_id = writer.add_channel(schema, "/mine", encoding, &BTreeMap::new()).unwrap();
        for message in messages {
            let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
            writer.write_to_known_channel(&header, message.as_bytes()).unwrap();
        }
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }

    #[test]
    fn messages_of_the_schema_are_read_from_any_topic_and_wrong_ones_are_named() {
        let found = rows(&file(
            "offbd.Sample",
            "json",
            &[
                r#"{"t_s": 1, "cmd_qx_rad": 0.1, "cmd_qy_rad": null, "x_m": 0.25, "y_m": -0.5}"#,
                r#"{"cmd_qx_rad": 0.1}"#,
                "not JSON",
            ],
        ))
        .unwrap();
        let (t_s, cmd_qx_rad) = (1.0, Some(0.1));
        let (x_m, y_m) = (Some(0.25), Some(-0.5));
        let first = Sample { t_s, cmd_qx_rad, x_m, y_m, ..Sample::default() };
        assert_eq!(found[0], Ok(first));
        assert!(found[1].as_ref().unwrap_err().starts_with("row 2: "), "{found:?}");
        assert!(found[2].as_ref().unwrap_err().starts_with("row 3: "), "{found:?}");
    }

    #[test]
    fn a_file_without_samples_says_which_schema_and_which_columns_it_lacks() {
        let error = rows(&file("offbd.Sample", "cdr", &["{}"])).unwrap_err().to_string();
        assert!(error.contains("`offbd.Sample`, and no other topic in JSON"), "{error}");
        let other = file("other", "json", &[r#"{"stamp": 1, "ball": {"x": 0}}"#]);
        let error = rows(&other).unwrap_err().to_string();
        let found = "lacks the column `t_s`; it has `stamp`, `ball.x`, `log_time`.";
        assert!(error.contains(found) && error.contains("t_s=stamp/s"), "{error}");
    }

    #[test]
    fn of_several_topics_in_json_none_is_chosen() {
        let mut writer = WriteOptions::new().create(Cursor::new(Vec::new())).unwrap();
        for topic in ["/ball", "/plate"] {
            let channel_id = writer.add_channel(0, topic, "json", &BTreeMap::new()).unwrap();
            let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
            writer.write_to_known_channel(&header, b"{}").unwrap();
        }
        writer.finish().unwrap();
        let error = rows(&writer.into_inner().into_inner()).unwrap_err().to_string();
        assert!(
            error.contains(
                "several other topics in JSON, `/ball`, `/plate`; a recording is read from one"
            ),
            "{error}"
        );
    }

    /// The messages of a session that is written with an asset file, by topic.
    fn shown(samples: &[Sample]) -> BTreeMap<String, Vec<Vec<u8>>> {
        let rig = Rig::chapter("shown");
        let info = SessionInfo {
            asset_file: Some(serde_json::to_string(&asset::view(&rig)).unwrap()),
            ..SessionInfo::default()
        };
        let (mut writer, mut file) = SessionWriter::new(SessionFormat::Mcap, &info, true).unwrap();
        file.extend(writer.rows(samples).unwrap());
        file.extend(writer.end().unwrap());
        let mut topics = BTreeMap::<String, Vec<Vec<u8>>>::new();
        for message in MessageStream::new(&file).unwrap() {
            let message = message.unwrap();
            let of_topic = topics.entry(message.channel.topic.clone()).or_default();
            of_topic.push(message.data.into_owned());
        }
        topics
    }

    fn decoded<M: Decode<Error: std::fmt::Debug>>(messages: &[Vec<u8>]) -> Vec<M> {
        messages.iter().map(|message| M::decode(&message[..]).unwrap()).collect()
    }

    #[test]
    fn a_positive_qy_lowers_the_side_of_the_plate_at_positive_x_and_a_positive_qx_raises_y() {
        for (cmd_qx_rad, cmd_qy_rad) in [(0.0, 0.1), (0.1, 0.0)] {
            let still = |i: u32| Sample {
                t_s: f64::from(i) * 0.02,
                cmd_qx_rad: Some(cmd_qx_rad),
                cmd_qy_rad: Some(cmd_qy_rad),
                x_m: Some(0.05),
                y_m: Some(-0.02),
                ..Sample::default()
            };
            let topics = shown(&(0..100).map(still).collect::<Vec<_>>());
            let frames: Vec<FrameTransforms> = decoded(&topics["/tf"]);
            let [plate, ball] = &frames.last().unwrap().transforms[..] else {
                panic!("{frames:?}")
            };
            let turned = plate.rotation.as_ref().unwrap();
            let turned = Quaternion::new(turned.w, turned.x, turned.y, turned.z);
            let turned = UnitQuaternion::from_quaternion(turned);
            let heights = [turned * Vector3::x(), turned * Vector3::y()].map(|side| side.z);
            let expected = [-cmd_qy_rad.sin(), cmd_qx_rad.sin()];
            for (height, expected) in heights.iter().zip(expected) {
                assert!((height - expected).abs() < 1e-9, "{heights:?}");
            }
            let ball = ball.translation.as_ref().unwrap();
            assert!((ball.x - 0.05).abs() < 1e-9, "{ball:?}");
            assert!((ball.y + 0.02).abs() < 1e-9, "{ball:?}");
        }
    }

    #[test]
    fn a_session_with_an_asset_file_shows_the_rig_once_and_each_fault() {
        let topics = shown(&crate::support::rig(6000, 3000));
        assert_eq!(topics["/offbd/samples"].len(), 6000);
        assert_eq!(topics["/rig"].len(), 1);
        let shown: Vec<SceneUpdate> = decoded(&topics["/rig"]);
        let ids: Vec<_> = shown[0].entities.iter().map(|entity| entity.id.as_str()).collect();
        assert_eq!(ids, ["plate", "ball"]);
        assert_eq!(topics["/tf"].len(), topics["/offbd/evidence"].len());
        let logs: Vec<Log> = decoded(&topics["/faults"]);
        let failed =
            |entry: &Log| entry.name == "x_servo" && entry.level >= i32::from(log::Level::Warning);
        assert!(logs.iter().any(failed), "{logs:?}");
    }
}

#[cfg(feature = "xlsx")]
mod workbooks {
    use super::*;

    #[test]
    fn the_first_sheet_is_read_with_numbers_as_numbers_or_text() {
        let file = include_bytes!("../../formats/openpyxl.xlsx");
        assert_eq!(SessionFormat::of(file), SessionFormat::Xlsx);
        assert_eq!(samples(file), samples(CSV_FILE));
    }

    #[test]
    fn a_time_may_be_a_date_and_a_wrong_cell_is_named() {
        let found = rows(include_bytes!("../../formats/dates.xlsx")).unwrap();
        // Seconds of 2026-03-01 12:00:00.25 since 1970, by `date --utc +%s`.
        assert_eq!(found[0].as_ref().unwrap().t_s, 1_772_366_400.25);
        assert_eq!(found[1].as_ref().unwrap().t_s, 90.0);
        let wrong: Vec<&str> =
            found[2..].iter().map(|row| row.as_ref().unwrap_err().as_str()).collect();
        assert_eq!(
            wrong,
            [
                "row 4: sheet `Data`, `cmd_qx_rad`: `left` is not a number",
                "row 5: sheet `Data`, `x_m`: `2026-03-01T12:00:00.25Z` is not a number",
                "row 6: sheet `Data`, `x_m`: `true` is not a number",
                "row 7: sheet `Data`, `seq` is not a whole number",
                "row 8: sheet `Data`, `t_s` is empty",
            ]
        );
    }

    #[test]
    fn a_missing_column_is_named_with_its_sheet() {
        let error = rows(include_bytes!("../../formats/columns.xlsx")).unwrap_err().to_string();
        let lacks = "sheet `Run 1`: the table lacks the column `cmd_qy_rad`; it has `t_s`, `x_m`";
        assert!(error.starts_with(lacks), "{error}");
    }

    #[test]
    fn no_end_that_comes_too_early_and_no_wrong_byte_stops_the_program() {
        let file = include_bytes!("../../formats/openpyxl.xlsx");
        for n in 4..file.len() {
            assert!(rows(&file[..n]).is_err(), "{n} of {} bytes", file.len());
        }
        for at in (4..file.len()).step_by(7) {
            let mut damaged = file.to_vec();
            damaged[at] ^= 0xff;
            let _ = rows(&damaged);
        }
    }
}
