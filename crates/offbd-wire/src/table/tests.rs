use super::*;
use crate::session_csv::write;
use proptest::prelude::*;

fn read(text: &str) -> Vec<Result<Sample, RowError>> {
    TableReader::batch(text.as_bytes(), &TableOptions::default()).unwrap().collect()
}

#[test]
fn columns_may_have_any_order_and_unknown_ones_are_ignored() {
    let rows = read("y_m,note,t_s,cmd_qy_rad,x_m,cmd_qx_rad\n,hello,1.5,,0.25,-0.1\n");
    let wanted = Sample { t_s: 1.5, cmd_qx_rad: Some(-0.1), x_m: Some(0.25), ..Sample::default() };
    assert_eq!(rows, [Ok(wanted)]);
}

#[test]
fn a_row_that_is_too_long_is_not_held_in_memory() {
    let start = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,0,0\n1,0,0,0,\"";
    for rest in ["0", "0\n"] {
        let rest = rest.as_bytes().repeat(8 << 20);
        let mut reader =
            TableReader::batch(start.as_bytes().chain(&rest[..]), &TableOptions::default())
                .unwrap();
        assert!(reader.next().unwrap().is_ok());
        let error = reader.next().unwrap().unwrap_err();
        assert!(error.reason.contains("longer than 1 MiB"), "{error}");
        assert!(reader.next().is_none_or(|row| row.is_err()));
    }
    let header = TableReader::batch(io::repeat(b'a'), &TableOptions::default());
    assert!(matches!(header, Err(CsvError::NoTable)));
}

#[test]
fn the_rows_after_a_row_that_is_too_long_are_read() {
    let long = "\0".repeat(3 << 20);
    let text = format!("t_s,cmd_qy_rad,x_m\n0,0,0\n{long}1,0,0\n2,0,0\n");
    let rows = read(&text);
    assert_eq!(rows[1].as_ref().unwrap_err().to_string(), "line 3: a row is longer than 1 MiB");
    assert_eq!(rows[2].as_ref().unwrap().t_s, 2.0);
    assert_eq!(rows.len(), 3);
}

#[test]
fn a_quotation_mark_that_is_never_closed_takes_no_other_row() {
    let text = "t_s,cmd_qy_rad,x_m,note\n0,0,0,\n1,0,0,\"lost\n2,0,0,\n3,0,0,found\"\n4,0,0,\"\n";
    let rows = read(text);
    let told: Vec<_> =
        rows.iter().map(|row| row.as_ref().map(|s| s.t_s).map_err(ToString::to_string)).collect();
    let never = |line: u64| Err(format!("line {line}: a quotation mark is never closed"));
    assert_eq!(told, [Ok(0.0), never(3), Ok(2.0), Ok(3.0), never(6)]);
}

#[test]
fn a_row_with_more_cells_is_not_read_as_another() {
    let rows = read("t_s,cmd_qy_rad,x_m\n998.5,0,0.1,\n1,000.5,0,0.1\n1001.5,0,0.1\n");
    let error = rows[1].as_ref().unwrap_err().to_string();
    assert!(error.starts_with("line 3: 4 cells instead of 3; numbers with"), "{error}");
    assert!(rows[0].is_ok() && rows[2].is_ok());
    // Words may have separators.
    let rows = read("t_s cmd_qy_rad x_m note\n0 0 0.1 a\n1 0 0.1 the ball is lost\n");
    assert!(rows.iter().all(Result::is_ok), "{rows:?}");
}

#[test]
fn a_decimal_sign_may_come_late() {
    let zeros: String = (0..2000).map(|i| format!("{i};0;0\n")).collect();
    let rows = read(&format!("t_s;cmd_qy_rad;x_m\n{zeros}2000,5;0,1;0,2\n"));
    assert_eq!(rows[2000].as_ref().unwrap().x_m, Some(0.2));
}

#[test]
fn a_table_is_found_after_lines_with_as_many_cells_as_each_other() {
    for before in ["Rig,3\nDate,Monday\n", "Rig: 3\nDate: Monday\n", "0,1,2,3\n"] {
        let rows = read(&format!("{before}t_s,cmd_qy_rad,x_m\n0,0,0.1\n0.1,0,0.1\n"));
        assert_eq!(rows.len(), 2, "{before}");
        assert!(rows.iter().all(Result::is_ok), "{before}: {rows:?}");
    }
    let rows = read("t_s,cmd_qy_rad,x_m\n0,0\n0.1,0,0.1\n0.2,0,0.1\n");
    assert_eq!(rows.iter().filter(|row| row.is_ok()).count(), 2);
    let lines = "Operator,Ann\nSamples,3\nms,q,x\n0,1,2\n20,1,2\n40,1,2\n";
    assert_eq!(times(lines, "t_s=ms/ms, cmd_qy_rad=q/deg, x_m=x/cm", None).len(), 3);
}

#[test]
fn names_may_stand_in_a_comment_beside_words_and_above_units() {
    let text = "%time,field.q,field.x,frame\n0,0,0.1,map\n1,0,0.1,map\n";
    let columns = "t_s=time, cmd_qy_rad=field.q, x_m=field.x";
    assert_eq!(times(text, columns, None), [(1, 0.0), (1, 1.0)]);
    let text = "# rig 3\n# t q x\n# s rad m\n0 0 0.1\n1 0 0.1\n";
    assert_eq!(times(text, "t_s=t, cmd_qy_rad=q, x_m=x", None), [(1, 0.0), (1, 1.0)]);
    let text = "#,t_s,cmd_qy_rad,x_m\n0,0.0,0,0.1\n1,0.5,0,0.1\n";
    assert_eq!(times(text, "", None), [(1, 0.0), (1, 0.5)]);
}

#[test]
fn the_first_row_of_values_is_neither_names_nor_units() {
    let by_number = "t_s=#1, cmd_qy_rad=#2, x_m=#3";
    assert_eq!(times("13:51:00,0,0.1,up\n13:51:01,0,0.1,up\n", by_number, None).len(), 2);
    let text = "t,q,x\n0 s,1 rad,2 m\n1 s,1 rad,2 m\n";
    let error = recorded(text, by_number, None).unwrap_err();
    assert!(error.contains("line 2: `cmd_qy_rad`: `1 rad` is not a number"), "{error}");
}

#[test]
fn a_name_of_two_columns_is_never_taken_silently() {
    let text = "t,x,q,x\n0,5,0,0.1\n1,5,0,0.2\n";
    let error = recorded(text, "t_s=t, cmd_qy_rad=q, x_m=x", None).unwrap_err();
    assert!(error.contains("`x`: is the name of two columns; write #2 or #4"), "{error}");
    let twice = recorded("t_s,t_s,cmd_qy_rad,x_m\n0,0,0,0\n", "", None).unwrap_err();
    assert!(twice.contains("`t_s=#1` or `t_s=#2`"), "{twice}");
}

#[test]
fn numbers_of_columns_are_not_for_a_table_with_own_names() {
    let text = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n5,0,0,0.1,0.2\n";
    let of_rig = "t_s=#1/ms, cmd_qy_rad=#3, x_m=#5".parse().unwrap();
    let options = TableOptions { of_rig, ..TableOptions::default() };
    let read: Vec<_> = TableReader::recording(text.as_bytes(), &options).unwrap().collect();
    let sample = read[0].as_ref().unwrap();
    assert_eq!((sample.t_s, sample.x_m), (5.0, Some(0.1)));
}

#[test]
fn an_invalid_row_is_reported_with_its_line_and_the_next_row_is_read() {
    let rows = read(
        "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,abc,0\n1,0\n2,0,0,NaN,0\n,0,0,0,0\n4,0,0,0,0\n",
    );
    let errors: Vec<String> =
        rows.iter().filter_map(|r| r.as_ref().err()).map(ToString::to_string).collect();
    assert_eq!(
        errors,
        [
            "line 2: `x_m`: `abc` is not a number",
            "line 3: no field `cmd_qy_rad`",
            "line 5: `t_s` is empty",
        ]
    );
    assert_eq!(rows[4].as_ref().unwrap().t_s, 4.0);
}

#[test]
fn a_header_with_a_missing_or_repeated_column_is_rejected() {
    let error = TableReader::batch("t_s,x_m,y_m,cmd_qx_rad\n".as_bytes(), &TableOptions::default())
        .err()
        .unwrap();
    assert!(error.to_string().contains("`cmd_qy_rad`"), "{error}");
    let error = TableReader::batch(
        "t_s,t_s,x_m,y_m,cmd_qx_rad,cmd_qy_rad\n".as_bytes(),
        &TableOptions::default(),
    )
    .err()
    .unwrap();
    assert!(error.to_string().contains("twice"), "{error}");
    assert!(TableReader::batch(&b""[..], &TableOptions::default()).is_err());
}

fn finite() -> impl Strategy<Value = f64> {
    proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO
}

proptest! {
    #[test]
    fn written_samples_are_read_back_bit_for_bit(
        rows in proptest::collection::vec(
            (proptest::option::of(0..u64::MAX), finite(), proptest::array::uniform4(proptest::option::of(finite()))),
            0..20,
        )
    ) {
        let samples: Vec<Sample> = rows.into_iter().map(|(seq, t_s, [a, b, c, d])| Sample {
            seq, t_s, cmd_qx_rad: a, cmd_qy_rad: b, x_m: c, y_m: d,
        }).collect();
        let mut text = Vec::new();
        write(&mut text, &samples).unwrap();
        let back: Vec<Sample> = TableReader::batch(text.as_slice(), &TableOptions::default()).unwrap().map(Result::unwrap).collect();
        prop_assert_eq!(back.len(), samples.len());
        for (a, b) in back.iter().zip(&samples) {
            prop_assert_eq!(format!("{:?}", a), format!("{:?}", b));
        }
    }
}

fn recorded(
    text: &str,
    columns: &str,
    rate_hz: Option<f64>,
) -> Result<Vec<(usize, Sample)>, String> {
    let options =
        TableOptions { columns: columns.parse().unwrap(), rate_hz, ..TableOptions::default() };
    let mut reader =
        TableReader::recording(text.as_bytes(), &options).map_err(|e| e.to_string())?;
    let mut rows = Vec::new();
    while let Some(row) = reader.next() {
        rows.push((reader.n_runs(), row.map_err(|e| e.to_string())?));
    }
    Ok(rows)
}

fn times(text: &str, columns: &str, rate_hz: Option<f64>) -> Vec<(usize, f64)> {
    let rows = recorded(text, columns, rate_hz).unwrap();
    rows.iter().map(|(run, sample)| (*run, sample.t_s)).collect()
}

/// Only a time of day without hours begins again at the hour.
#[test]
fn a_clock_begins_again_where_it_has_no_more_digits() {
    let rows = |cells: &[&str]| -> String {
        let row = |cell: &&str| format!("{cell},0,0.1\n");
        "t_s,cmd_qy_rad,x_m\n".to_owned() + &cells.iter().map(row).collect::<String>()
    };
    let read = |cells: &[&str]| times(&rows(cells), "", None);
    assert_eq!(read(&["59:59.0", "59:59.5", "00:00.0"])[2], (1, 3_600.0));
    assert_eq!(read(&["23:59:59.0", "23:59:59.5", "00:00:00.0"])[2], (1, 86_400.0));
    assert_eq!(read(&["00:00:00.0", "00:59:59.0", "00:59:59.5", "00:00:00.0"])[3], (2, 0.0));
    assert_eq!(read(&["0.5 sec", "3599 sec", "3599.5 sec", "0 sec"])[3], (2, 0.0));
    let mixed = recorded(&rows(&["05:00.99", "05:01"]), "", None).unwrap_err();
    assert!(mixed.contains("may be hours and minutes or minutes and seconds"), "{mixed}");
}

#[test]
fn names_of_rows_may_come_again() {
    let row = |i: usize| format!("\"{i}\" {i} 0 0.1\n");
    let text =
        "\"t_s\" \"cmd_qy_rad\" \"x_m\"\n".to_owned() + &(1..31).map(row).collect::<String>();
    let times = times(&(text.clone() + &text), "", None);
    assert_eq!((times[29], times[30], times.len()), ((1, 30.0), (2, 1.0), 60));
}

#[test]
fn a_spreadsheet_with_decimal_commas_is_read() {
    let text = "t_s;cmd_qx_rad;cmd_qy_rad;x_m;y_m\r\n0,0201;0,0076;-0,0216;0,0209;0,0051\r\n0,04;;;nan;NA\r\n";
    let rows = recorded(text, "", None).unwrap();
    assert_eq!(rows[0].1.x_m, Some(0.0209));
    assert_eq!((rows[1].1.t_s, rows[1].1.x_m, rows[1].1.cmd_qx_rad), (0.04, None, None));
}

#[test]
fn counts_without_names_and_time_are_mapped() {
    let text = "2286.0\t2197.0\t1879.0\n2284.0\t2190.0\t1940.0\n";
    let columns = "x_m=#1*0.0001-0.2, cmd_qy_rad=#3*0.0005-1";
    let rows = recorded(text, columns, Some(50.0)).unwrap();
    assert_eq!((rows[0].1.t_s, rows[1].1.t_s), (0.0, 0.02));
    assert!((rows[1].1.x_m.unwrap() - 0.0284).abs() < 1e-12, "{rows:?}");
    assert!((rows[1].1.cmd_qy_rad.unwrap() + 0.03).abs() < 1e-12, "{rows:?}");
    let error = recorded(text, columns, None).unwrap_err();
    assert!(
        error.contains("lacks the column `t_s`") && error.contains("3 columns without names"),
        "{error}"
    );
    let error = recorded(text, "x_m=#4/mm, cmd_qy_rad=#3", Some(50.0)).unwrap_err();
    assert!(error.contains("`#4`: is not a column"), "{error}");
}

#[test]
fn three_servos_of_a_parallel_rig_give_two_angles() {
    let text = "t,a,b,c,x,y\n0,3,6,9,0,0\n1,3,6,9,0,0\n";
    let columns =
        "t_s=t, cmd_qx_rad=b/deg*0.5-c/deg*0.5, cmd_qy_rad=a/deg-b/deg*0.5-c/deg*0.5, x_m=x, y_m=y";
    let rows = recorded(text, columns, None).unwrap();
    let degrees = |value: Option<f64>| value.unwrap().to_degrees();
    assert!((degrees(rows[0].1.cmd_qx_rad) + 1.5).abs() < 1e-12);
    assert!((degrees(rows[0].1.cmd_qy_rad) + 4.5).abs() < 1e-12);
}

#[test]
fn dates_become_seconds() {
    let text = "stamp,u,x\n2026-02-20T13:51:00.5+01:00,0,0\n2026-02-20T13:51:01+01:00,0,0\n";
    let columns = "t_s=stamp, cmd_qy_rad=u, x_m=x";
    assert_eq!(times(text, columns, None), [(1, 1_771_591_860.5), (1, 1_771_591_861.0)]);
    let text = "day;clock;u;x\n20.02.2026;23:59:59,5;0;0\n21.02.2026;00:00:00,5;0;0\n";
    let columns = "t_s=day+clock, cmd_qy_rad=u, x_m=x";
    let seconds = times(text, columns, None);
    assert_eq!(seconds[1].1 - seconds[0].1, 1.0);
    let text = "stamp,u,x\n2026-02-20,0,0\nyesterday,0,0\n";
    let error = recorded(text, "t_s=stamp, cmd_qy_rad=u, x_m=x", None).unwrap_err();
    assert!(error.contains("line 3: `t_s`: `yesterday` is not a date or a time of day"), "{error}");
}

#[test]
fn a_counter_that_wraps_goes_on() {
    let text = "ms,u,x\n65500,0,0\n65520,0,0\n4,0,0\n24,0,0\n";
    let seconds = times(text, "t_s=ms/ms, cmd_qy_rad=u, x_m=x", None);
    let expected = [65.5, 65.52, 65.54, 65.56];
    for ((run, t_s), expected) in seconds.iter().zip(expected) {
        assert!(*run == 1 && (t_s - expected).abs() < 1e-9, "{seconds:?}");
    }
}

#[test]
fn a_clock_that_starts_again_is_not_a_counter_that_wraps() {
    let run =
        |seconds: u32| (0..10 * seconds).map(|i| format!("{},0,0\n", 100 * i)).collect::<String>();
    let columns = "t_s=ms/ms, cmd_qy_rad=u, x_m=x";
    for seconds in [55, 60, 65] {
        let both = times(&format!("ms,u,x\n{}{}", run(seconds), run(2)), columns, None);
        let (n_run, t_s) = both[both.len() - 1];
        assert!(n_run == 2 && (t_s - 1.9).abs() < 1e-9, "{seconds}: {n_run}, {t_s}");
    }
    // A pause before it is not a long step of the counter.
    let paused = format!("ms,u,x\n{}40500,0,0\n{}", run(40), run(2));
    assert_eq!(times(&paused, columns, None).last().map(|(run, _)| *run), Some(2));
    // An offset does not hide a wrap.
    let text = "us,u,x\n4294960000,0,0\n4294965000,0,0\n2704,0,0\n7704,0,0\n";
    let seconds = times(text, "t_s=us/us+1, cmd_qy_rad=u, x_m=x", None);
    assert!((seconds[3].1 - 4295.975).abs() < 1e-6 && seconds[3].0 == 1, "{seconds:?}");
}

#[test]
fn a_time_of_day_goes_on_after_midnight() {
    let text = "clock,u,x\n23:59:59.0,0,0\n23:59:59.5,0,0\n00:00:00.0,0,0\n00:00:00.5,0,0\n";
    let seconds = times(text, "t_s=clock, cmd_qy_rad=u, x_m=x", None);
    assert_eq!(seconds.last(), Some(&(1, 86_400.5)));
    let text = "clock,u,x\n17:00:00,0,0\n17:00:01,0,0\n09:00:00,0,0\n";
    assert_eq!(times(text, "t_s=clock, cmd_qy_rad=u, x_m=x", None)[2], (2, 32_400.0));
}

#[test]
fn a_clock_that_starts_again_begins_a_run() {
    let head = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n";
    let run = "0,0,0,0,0\n1,0,0,0,0\n2,0,0,0,0\n";
    let both = [(1, 0.0), (1, 1.0), (1, 2.0), (2, 0.0), (2, 1.0), (2, 2.0)];
    assert_eq!(times(&format!("{head}{run}{run}"), "", None), both);
    // Only valid rows begin one.
    let wrong = format!("{head}{run}0,0,0,abc,0\n3,0,0,0,0\n");
    let mut reader = TableReader::recording(wrong.as_bytes(), &TableOptions::default()).unwrap();
    assert_eq!((reader.by_ref().count(), reader.n_runs()), (5, 1));
    assert_eq!(times(&format!("{head}{run}{head}{run}"), "", None), both);
    // A row that is late is not a run, and a batch has none.
    let late = format!("{head}0,0,0,0,0\n1,0,0,0,0\n2,0,0,0,0\n1.5,0,0,0,0\n");
    assert_eq!(times(&late, "", None), [(1, 0.0), (1, 1.0), (1, 2.0), (1, 1.5)]);
    let text = format!("{head}{run}{run}");
    let mut batch = TableReader::batch(text.as_bytes(), &TableOptions::default()).unwrap();
    assert_eq!(batch.by_ref().count(), 6);
    assert_eq!(batch.n_runs(), 1);
}

#[test]
fn times_in_another_unit_are_doubted() {
    for (size, unit) in [(1_u64, "ms"), (1000, "us"), (1_000_000, "ns")] {
        let row = |i: u64| format!("{},0,0,0,0\n", (1_771_570_260_336 + 20 * i) * size);
        let rows: String = (0..5).map(row).collect();
        let text = format!("t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n{rows}");
        let error = recorded(&text, "", None).unwrap_err();
        assert!(error.contains(&format!("is it in {unit}?")), "{error}");
        assert_eq!(recorded(&text, &format!("t_s=t_s/{unit}"), None).unwrap().len(), 5);
    }
}

#[test]
fn comments_and_blank_lines_are_skipped_and_lines_counted() {
    let text = "# a rig\nnotes: none\nt_s  cmd_qy_rad  x_m\n# begun\n 0  0   0\n\n 0.1  0 abc\n";
    let rows: Vec<_> =
        TableReader::recording(text.as_bytes(), &TableOptions::default()).unwrap().collect();
    assert_eq!(rows.len(), 2);
    assert_eq!(rows[1].as_ref().unwrap_err().to_string(), "line 7: `x_m`: `abc` is not a number");
}

#[test]
fn a_file_with_other_names_is_refused_with_a_mapping() {
    let text = "time,x,u\n0,1,2\n0.01,1,2\n";
    let error = recorded(text, "", None).unwrap_err();
    assert_eq!(
        error,
        "the table lacks the column `t_s`; it has `time`, `x`, `u`. This mapping is likely: \
         `t_s=time/s, cmd_qy_rad=u/UNIT, x_m=x/UNIT`; `offbd inspect` proposes each UNIT by the motion"
    );
    let text = "time,x,y,MV_x,MV_y\n0,1,2,3,4\n0.01,1,2,3,4\n";
    let error = recorded(text, "", None).unwrap_err();
    assert!(
        error.ends_with("proposes each UNIT, and which command is which, by the motion"),
        "{error}"
    );
    let error = recorded("a\nb\n", "", None).unwrap_err();
    assert!(error.contains("no line has two or more columns"), "{error}");
}

#[test]
fn a_quotation_mark_within_a_cell_is_a_character() {
    let head = "t_s,cmd_qy_rad,x_m,note\n";
    let row = |t: &str, note: &str| format!("{t},0,0,{note}\n");
    let notes = ["5\" ball", "\"a, b\"", "\"two\nlines\"", "\"say \"\"so\"\"\"", "it's", "6\" 7"];
    let rows: String = notes.iter().enumerate().map(|(i, n)| row(&i.to_string(), n)).collect();
    let expected: Vec<(usize, f64)> = (0..notes.len()).map(|i| (1, i as f64)).collect();
    assert_eq!(times(&format!("{head}{rows}"), "", None), expected);
}

#[test]
fn a_header_without_rows_is_not_a_run() {
    let head = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n";
    let text = format!("{head}{head}0,0,0,0,0\n1,0,0,0,0\n{head}");
    let mut reader = TableReader::recording(text.as_bytes(), &TableOptions::default()).unwrap();
    assert_eq!((reader.by_ref().count(), reader.n_runs()), (2, 1));
}

#[test]
fn lines_may_end_with_a_carriage_return_alone() {
    let text = "t_s,cmd_qy_rad,x_m\r0,0.1,0.2\r0.01,0.1,0.2\r";
    let rows = TableReader::recording(text.as_bytes(), &TableOptions::default()).unwrap();
    assert_eq!(rows.map(|row| row.unwrap().t_s).collect::<Vec<_>>(), [0.0, 0.01]);
}

#[test]
fn a_file_of_blanks_is_empty() {
    let error = TableReader::batch(&b" \n"[..], &TableOptions::default()).err().unwrap();
    assert_eq!(error.to_string(), "the file is empty");
}
