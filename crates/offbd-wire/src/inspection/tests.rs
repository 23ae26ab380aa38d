use super::motion::ASKED_M_S2;
use super::*;
use std::io::Cursor;

/// A ball that rolls on a plate tilted by two sines, as an owner's program writes it: the columns
/// `t`, `u`, `v`, `x`, `y` with these factors from seconds, radians and metres. The command `u`
/// tilts about y.
fn recording(header: &str, factors: [f64; 5]) -> Cursor<Vec<u8>> {
    let mut text = format!("{header}\n");
    for i in 0..3000 {
        let t_s = f64::from(i) * 0.01;
        let (u, v) = (0.05 * (2.0 * t_s).sin(), 0.04 * (1.7 * t_s).cos());
        let row = [t_s, u, v, -ASKED_M_S2 * u / 4.0, ASKED_M_S2 * v / (1.7 * 1.7)];
        let row = row.iter().zip(factors).map(|(value, factor)| format!("{:.6}", value * factor));
        text += &(row.collect::<Vec<_>>().join(";") + "\n");
    }
    Cursor::new(text.into_bytes())
}

fn inspected(header: &str, factors: [f64; 5], columns: &str) -> InspectionView {
    let options = TableOptions { columns: columns.parse().unwrap(), ..TableOptions::default() };
    inspect(recording(header, factors), &options).unwrap()
}

/// The remarks, each as `TEXT [QUANTITY=EXPRESSION …]`.
fn remarks(view: &InspectionView) -> Vec<String> {
    let change = |c: &MappingChangeView| format!("{}={}", c.quantity, c.expression);
    let line = |remark: &InspectionRemarkView| {
        let changes: Vec<String> = remark.changes.iter().map(change).collect();
        format!("{} [{}]", remark.text, changes.join(" "))
    };
    view.remarks.iter().map(line).collect()
}

fn quantity(view: &InspectionView, name: &str) -> InspectedQuantityView {
    view.quantities.iter().find(|quantity| quantity.quantity == name).unwrap().clone()
}

const DEG: f64 = 180.0 / std::f64::consts::PI;

#[test]
fn a_file_with_the_names_of_the_quantities_needs_no_mapping() {
    let view = inspected("t_s;cmd_qy_rad;cmd_qx_rad;x_m;y_m", [1.0; 5], "");
    assert_eq!((view.mapping.as_str(), view.rows), ("", 3000));
    assert_eq!(remarks(&view), Vec::<String>::new());
    assert!(view.quantities.iter().all(|quantity| quantity.reason.is_none()), "{view:?}");
    let x = quantity(&view, "x_m");
    assert_eq!(x.expression.as_deref(), Some("x_m/m"));
    // Of the amplitude of the motion, which the sine of the command asks for.
    let amplitude = ASKED_M_S2 * 0.05 / 4.0;
    assert!((x.from.unwrap() + amplitude).abs() < 1e-4, "{x:?}");
    assert!((x.to.unwrap() - amplitude).abs() < 1e-4, "{x:?}");
    let InspectedMotionView { t_s, x_m, y_m } = &view.motion;
    assert_eq!((t_s.len(), x_m.len(), y_m.len(), t_s[1]), (1000, 1000, 1000, 0.03));
    assert!((view.rate_hz.unwrap() - 100.0).abs() < 1e-6, "{view:?}");
    assert_eq!((view.runs, view.rejected, view.gaps, view.without_ball), (1, 0, 0, 0.0));
    assert_eq!(view.layout, ["UTF-8, separated by semicolons"]);
}

#[test]
fn the_motion_decides_units_signs_and_axes() {
    // Centimetres, which by their size could be millimetres, and degrees.
    let view = inspected("time;MV_x;MV_y;x;y", [1.0, DEG, DEG, 100.0, 100.0], "");
    assert_eq!(
        view.mapping,
        "t_s=time/s, cmd_qx_rad=MV_y/deg, cmd_qy_rad=MV_x/deg, x_m=x/cm, y_m=y/cm"
    );
    let x = quantity(&view, "x_m");
    assert_eq!(x.expression.as_deref(), Some("x/cm"));
    assert_eq!(x.reason.as_deref(), Some("the motion decides"));
    // What is shown is read by what the motion decides.
    let amplitude = ASKED_M_S2 * 0.05 / 4.0;
    assert!((x.to.unwrap() - amplitude).abs() < 1e-4, "{x:?}");
    assert!((view.first[0].y_m.unwrap() - ASKED_M_S2 * 0.04 / 2.89).abs() < 1e-6, "{view:?}");
    assert_eq!(view.rows, 3000);
    // A command of the opposite sign, and commands that are named by the axis of the motion.
    let view = inspected("t;roll;pitch;x;y", [1.0, -1.0, 1.0, 1.0, 1.0], "");
    assert_eq!(
        view.mapping,
        "t_s=t/s, cmd_qx_rad=pitch/rad, cmd_qy_rad=-roll/rad, x_m=x/m, y_m=y/m"
    );
    assert_eq!(remarks(&view), Vec::<String>::new());
    // Commands whose names say no axis.
    for (header, mapping) in [
        ("t;servo_1;servo_2;x;y", "cmd_qx_rad=servo_2/rad, cmd_qy_rad=servo_1/rad"),
        ("t;servo_1;servo_2;y;x", "cmd_qx_rad=-servo_1/rad, cmd_qy_rad=-servo_2/rad"),
    ] {
        let view = inspected(header, [1.0; 5], "");
        assert_eq!(view.mapping, format!("t_s=t/s, {mapping}, x_m=x/m, y_m=y/m"));
    }
}

/// One axis whose servo is dead says nothing of its unit; the other one does.
#[test]
fn both_coordinates_have_the_unit_that_the_motion_of_one_decides() {
    let still = recording("time;MV_x;MV_y;x;y", [1.0, DEG, DEG, 100.0, 100.0]);
    let text = String::from_utf8(still.into_inner()).unwrap();
    let dead = |(i, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(';').map(str::to_owned).collect();
        if i > 0 {
            cells[3] = format!("{}", 1.0 + f64::from((i * 7 % 13) as u32) * 0.01);
        }
        cells.join(";")
    };
    let text: Vec<String> = text.lines().enumerate().map(dead).collect();
    let file = Cursor::new(text.join("\n").into_bytes());
    let view = inspect(file, &TableOptions::default()).unwrap();
    assert!(view.mapping.ends_with("x_m=x/cm, y_m=y/cm"), "{}", view.mapping);
    assert_eq!(quantity(&view, "x_m").reason.as_deref(), Some("as `y_m`"));
}

#[test]
fn what_is_stated_is_not_changed_but_doubted() {
    let header = "t_s;cmd_qy_rad;cmd_qx_rad;x;y";
    let columns = "x_m=x/mm, y_m=y/mm";
    let view = inspected(header, [1.0, 1.0, 1.0, 100.0, 100.0], columns);
    assert!(view.mapping.ends_with("x_m=x/mm, y_m=y/mm"), "{}", view.mapping);
    let asked = |axis: &str| {
        format!(
            "the motion along {axis} is 0.10 of what the commands ask: is `{axis}_m` in cm? \
             [{axis}_m={axis}/cm]"
        )
    };
    assert_eq!(remarks(&view), [asked("x"), asked("y")]);
    let header = "t_s;cmd_qy_rad;cmd_qx_rad;x_m;y_m";
    let view = inspected(header, [1.0, 1.0, 1.0, 0.1, 0.1], "");
    let factor = "no unit of the quantities explains that, a factor of 10 of the positions does";
    assert!(remarks(&view)[0].contains(factor), "{:?}", view.remarks);
    let view = inspected(header, [1.0, 1.0, -1.0, 1.0, 1.0], "");
    let against = "the ball moves along y against `cmd_qx_rad`: is a sign wrong? \
        [cmd_qx_rad=-cmd_qx_rad/rad]";
    assert_eq!(remarks(&view), [against]);
    let view = inspected("t_s;cmd_qx_rad;cmd_qy_rad;x_m;y_m", [1.0; 5], "");
    let exchanged = "exchanged? [cmd_qx_rad=cmd_qy_rad/rad cmd_qy_rad=cmd_qx_rad/rad]";
    assert!(remarks(&view)[0].ends_with(exchanged), "{:?}", view.remarks);
}

#[test]
fn a_mapping_that_is_given_is_used() {
    let view =
        inspected("a;b;c;d;e", [1e3, DEG, DEG, 1e3, 1e3], "t_s=a/ms, cmd_qy_rad=b/deg, x_m=d/mm");
    assert_eq!(view.mapping, "t_s=a/ms, cmd_qy_rad=b/deg, x_m=d/mm");
    assert_eq!(remarks(&view), Vec::<String>::new());
    assert!((view.to_s.unwrap() - 29.99).abs() < 1e-9);
    let view = inspected("a;b;c;d;e", [1.0; 5], "");
    assert!(remarks(&view)[0].contains("there is no time"), "{:?}", view.remarks);
    assert_eq!(view.rows, 0);
    let options =
        TableOptions { columns: "x_m=nope/mm".parse().unwrap(), ..TableOptions::default() };
    let error = inspect(recording("t_s;b;c;d;e", [1.0; 5]), &options).unwrap_err().to_string();
    assert!(error.contains("`nope`: is not a column of the file, which has `t_s`"), "{error}");
}

#[test]
fn a_quantity_that_is_left_out_is_not_guessed() {
    let header = "time;roll;pitch;x;y";
    let view = inspected(header, [1.0; 5], "y_m=none, cmd_qx_rad=none");
    assert!(view.mapping.contains("cmd_qx_rad=none"), "{}", view.mapping);
    assert!(view.mapping.ends_with("y_m=none"), "{}", view.mapping);
    assert_eq!(quantity(&view, "y_m").expression.as_deref(), Some("none"));
    assert!(view.first.iter().all(|sample| sample.y_m.is_none() && sample.x_m.is_some()));
    // The columns have the names, and are not used.
    let mapped = "cmd_qx_rad=none, cmd_qy_rad=none";
    let view = inspected("t_s;cmd_qy_rad;cmd_qx_rad;x_m;y_m", [1.0; 5], mapped);
    assert!(view.first.iter().all(|s| s.cmd_qy_rad.is_none() && s.y_m.is_some()), "{view:?}");
    let all = "cmd_qx_rad=none, cmd_qy_rad=none, x_m=none, y_m=none";
    let view = inspected("t_s;cmd_qy_rad;cmd_qx_rad;x_m;y_m", [1.0; 5], all);
    assert!(remarks(&view)[0].contains("no column is likely to be `x_m`"), "{:?}", view.remarks);
}

#[test]
fn pixels_and_counts_are_not_lengths() {
    let header = "t_s;pitch_deg;roll_deg;ball_x_px;ball_y_px";
    let factors = [1.0, DEG, DEG, 2000.0, 2000.0];
    let view = inspected(header, factors, "");
    assert!(!view.mapping.contains("_px"), "{}", view.mapping);
    let told = "pixels and counts need a factor and an offset, such as \
                `x_m=ball_x_px*0.0005-0.16`: `ball_x_px`, `ball_y_px`";
    assert!(remarks(&view)[0].starts_with(told), "{:?}", view.remarks);
    let view = inspected(header, factors, "x_m=ball_x_px*0.0005, y_m=ball_y_px*0.0005");
    assert_eq!(remarks(&view), Vec::<String>::new());
}

#[test]
fn dates_are_found_whatever_their_columns_are_called() {
    for (names, first, mapping) in [
        ("Datum;Uhrzeit", "20.02.2026;13:51:00,5", "t_s=Datum/s+Uhrzeit/s"),
        ("Uhrzeit;Datum", "13:51:00,5;20.02.2026", "t_s=Datum/s+Uhrzeit/s"),
        ("when;no", "20-Feb-2026 13:51:00;7", "t_s=when/s"),
    ] {
        let text = format!("{names};cmd_qy_rad;x_m\n{first};0,1;0,1\n{first};0,1;0,1\n");
        let view = inspect(Cursor::new(text.into_bytes()), &TableOptions::default()).unwrap();
        assert!(view.mapping.starts_with(mapping), "{names}: {}", view.mapping);
        assert_eq!(view.rows, 2, "{names}");
        let told = &view.remarks[view.remarks.len() - 1].text;
        assert!(told.contains("1 of 2 rows have the time of the row before"), "{told}");
    }
}

#[test]
fn a_column_whose_name_another_one_has_is_written_by_its_number() {
    let text = "t,x,q,x\n0,5,0,0.1\n1,5,0,0.2\n";
    let options = TableOptions {
        columns: "t_s=t, cmd_qy_rad=q, x_m=#4".parse().unwrap(),
        ..TableOptions::default()
    };
    let view = inspect(Cursor::new(text), &options).unwrap();
    assert_eq!(view.mapping, "t_s=t/s, cmd_qy_rad=q/rad, x_m=#4/m");
}
