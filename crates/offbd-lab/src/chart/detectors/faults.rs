//! The simulated faults, and their names.

/// All kinds of faults, those with a size at two or three sizes, from obvious to barely
/// detectable.
pub(super) const ALL: [&str; 26] = [
    "x_servo:dead",
    "y_servo:hold",
    "x_servo:reversed",
    "y_servo:intermittent",
    "y_servo:gain=0.2",
    "x_servo:gain=0.5",
    "y_servo:gain=0.7",
    "x_servo:offset=0.05",
    "y_servo:offset=-0.035",
    "x_servo:offset=0.02",
    "y_servo:slow=16",
    "x_servo:slow=8",
    "y_servo:slow=4",
    "stuck_ball:glued",
    "stuck_ball:sticky=0.1",
    "stuck_ball:sticky=0.05",
    "sensor:freeze",
    "sensor:freeze_axis=y",
    "sensor:dropout=1",
    "sensor:dropout=0.6",
    "sensor:noise=12",
    "sensor:noise=6",
    "sensor:spikes=0.2",
    "sensor:spikes=0.05",
    "sensor:jump=0.035,-0.02",
    "sensor:jump=0.01,0",
];

/// One fault of each code, and a small one.
pub(super) const FEW: [&str; 5] = [
    "x_servo:dead",
    "y_servo:gain=0.2",
    "x_servo:offset=0.02",
    "stuck_ball:glued",
    "sensor:jump=0.035,-0.02",
];

/// Returns whether a fault is one of a servo, which a residual can isolate.
pub(super) fn is_servo(fault: &str) -> bool {
    fault.contains("_servo:")
}

/// Returns the name of a fault: `servo gain 0.5`, `servo offset 2.9°`.
pub(super) fn words(fault: &str) -> String {
    let (_, what) = fault.split_once(':').unwrap_or(("", fault));
    let (kind, size) = what.split_once('=').unwrap_or((what, ""));
    let number: f64 = size.split(',').next().and_then(|w| w.parse().ok()).unwrap_or_default();
    match kind {
        "dead" | "hold" | "reversed" | "intermittent" => format!("servo {kind}"),
        "offset" => format!("servo offset {:.1}°", number.abs().to_degrees()),
        "gain" => format!("servo gain {number}"),
        "slow" => format!("servo {number}× slower"),
        "glued" => "ball glued".to_owned(),
        "sticky" => format!("ball sticks to {:.1}°", number.to_degrees()),
        "freeze" => "readings frozen".to_owned(),
        "freeze_axis" => "one axis frozen".to_owned(),
        "dropout" => format!("dropout {:.0} %", 100.0 * number),
        "noise" => format!("noise {number}×"),
        "spikes" => format!("spikes {:.0} %", 100.0 * number),
        _ => format!("jump {:.0} mm", 1e3 * number),
    }
}
