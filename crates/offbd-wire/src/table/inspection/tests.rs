use super::*;

/// A ball that rolls on a plate tilted by two sines, as an owner's program writes it: the columns
/// `t`, `u`, `v`, `x`, `y` with these factors from seconds, radians and metres. The command `u`
/// tilts about y.
fn recording(header: &str, factors: [f64; 5]) -> std::io::Cursor<Vec<u8>> {
    let mut text = format!("{header}\n");
    for i in 0..3000 {
        let t_s = f64::from(i) * 0.01;
        let (u, v) = (0.05 * (2.0 * t_s).sin(), 0.04 * (1.7 * t_s).cos());
        let row = [t_s, u, v, -ASKED_M_S2 * u / 4.0, ASKED_M_S2 * v / (1.7 * 1.7)];
        let row = row.iter().zip(factors).map(|(value, factor)| format!("{:.6}", value * factor));
        text += &(row.collect::<Vec<_>>().join(";") + "\n");
    }
    std::io::Cursor::new(text.into_bytes())
}

fn inspected(header: &str, factors: [f64; 5], columns: &str) -> InspectionView {
    let options = TableOptions { columns: columns.parse().unwrap(), rate_hz: None };
    inspect(recording(header, factors), &options).unwrap()
}

const DEG: f64 = 180.0 / std::f64::consts::PI;

#[test]
fn a_file_with_the_names_of_the_quantities_needs_no_mapping() {
    let view = inspected("t_s;cmd_qy_rad;cmd_qx_rad;x_m;y_m", [1.0; 5], "");
    assert_eq!((view.mapping.as_str(), view.guessed.len(), view.rows), ("", 0, 3000));
    assert_eq!(view.remarks, Vec::<String>::new());
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
    let x = view.guessed.iter().find(|guess| guess.quantity == "x_m").unwrap();
    assert_eq!((x.expression.as_str(), x.reason.as_str()), ("x/cm", REASON));
    // A command of the opposite sign, and commands that are named by the axis of the motion.
    let view = inspected("t;roll;pitch;x;y", [1.0, -1.0, 1.0, 1.0, 1.0], "");
    assert_eq!(
        view.mapping,
        "t_s=t/s, cmd_qx_rad=pitch/rad, cmd_qy_rad=-roll/rad, x_m=x/m, y_m=y/m"
    );
    assert_eq!(view.remarks, Vec::<String>::new());
}

#[test]
fn what_is_stated_is_not_changed_but_doubted() {
    let header = "t_s;cmd_qy_rad;cmd_qx_rad;x;y";
    let columns = "x_m=x/mm, y_m=y/mm";
    let view = inspected(header, [1.0, 1.0, 1.0, 100.0, 100.0], columns);
    assert!(view.mapping.ends_with("x_m=x/mm, y_m=y/mm"), "{}", view.mapping);
    let asked = |axis: &str| {
        format!("the motion along {axis} is 0.10 of what the commands ask: is `{axis}_m` in cm?")
    };
    assert_eq!(view.remarks, [asked("x"), asked("y")]);
    let header = "t_s;cmd_qy_rad;cmd_qx_rad;x_m;y_m";
    let view = inspected(header, [1.0, 1.0, 1.0, 0.1, 0.1], "");
    assert!(view.remarks[0].contains("is 0.10 of what the commands ask"), "{:?}", view.remarks);
    let view = inspected(header, [1.0, 1.0, -1.0, 1.0, 1.0], "");
    assert_eq!(view.remarks, ["the ball moves along y against `cmd_qx_rad`: is a sign wrong?"]);
    let view = inspected("t_s;cmd_qx_rad;cmd_qy_rad;x_m;y_m", [1.0; 5], "");
    assert!(view.remarks[0].contains("exchanged?"), "{:?}", view.remarks);
}

#[test]
fn a_mapping_that_is_given_is_used() {
    let view =
        inspected("a;b;c;d;e", [1e3, DEG, DEG, 1e3, 1e3], "t_s=a/ms, cmd_qy_rad=b/deg, x_m=d/mm");
    assert_eq!(view.mapping, "t_s=a/ms, cmd_qy_rad=b/deg, x_m=d/mm");
    assert_eq!(view.remarks, Vec::<String>::new());
    assert!((view.to_s.unwrap() - 29.99).abs() < 1e-9);
    let view = inspected("a;b;c;d;e", [1.0; 5], "");
    assert!(view.remarks[0].contains("there is no time"), "{:?}", view.remarks);
    assert_eq!(view.rows, 0);
    let options = TableOptions { columns: "x_m=nope/mm".parse().unwrap(), rate_hz: None };
    let error = inspect(recording("t_s;b;c;d;e", [1.0; 5]), &options).unwrap_err().to_string();
    assert!(error.contains("`nope`: is not a column of the file, which has `t_s`"), "{error}");
}
