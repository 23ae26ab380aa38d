//! The faults of a simulated rig, and their syntax on the command line:
//! `CODE:KIND[=SIZE]@START[-END]`, as in `y_servo:gain=0.5@20-40`.

mod injections;
mod size;

use std::fmt;
use std::str::FromStr;

pub use self::injections::{BallFault, SensorFault, ServoFault};
pub(super) use self::injections::{HornDrive, Reading, SensorLook};
use offbd_core::vocabulary::{Axis, FaultCode};

/// The faulty component and its fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultEffect {
    Servo(Axis, ServoFault),
    Ball(BallFault),
    Sensor(SensorFault),
}

impl FaultEffect {
    /// Returns the code of the correct diagnosis.
    #[must_use]
    pub const fn code(&self) -> FaultCode {
        match self {
            Self::Servo(axis, _) => FaultCode::servo(*axis),
            Self::Ball(_) => FaultCode::StuckBall,
            Self::Sensor(_) => FaultCode::Sensor,
        }
    }

    /// Returns the name of the kind of fault, as in the labels of a corpus.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Servo(_, fault) => fault.name(),
            Self::Ball(fault) => fault.name(),
            Self::Sensor(fault) => fault.name(),
        }
    }

    /// Returns the axis of the fault; `None` if it is not on one axis.
    #[must_use]
    pub fn axis(&self) -> Option<Axis> {
        match self {
            Self::Servo(axis, fault) => fault.axis().or(Some(*axis)),
            Self::Ball(fault) => fault.axis(),
            Self::Sensor(fault) => fault.axis(),
        }
    }

    /// Returns the size: a factor, an angle in rad, a probability or a shift in m; `None`
    /// if the fault has none. A dropout's probability is not returned.
    #[must_use]
    pub fn size(&self) -> Option<Vec<f64>> {
        match self {
            Self::Servo(_, fault) => fault.numbers(),
            Self::Ball(fault) => fault.numbers(),
            Self::Sensor(fault) => fault.numbers(),
        }
    }
}

/// A fault with its onset and end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    pub effect: FaultEffect,
    /// Onset on the rig's clock, s.
    pub onset_s: f64,
    /// Repair on the rig's clock, s; `None`: never.
    pub end_s: Option<f64>,
}

impl Fault {
    /// Returns whether the fault is active at `t_s`.
    #[must_use]
    pub fn active(&self, t_s: f64) -> bool {
        self.onset_s <= t_s && self.end_s.is_none_or(|end| t_s < end)
    }
}

/// A syntax error in a fault.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FaultSyntax {
    #[error(
        "`{0}` is not CODE:KIND[=SIZE]@START[-END], as in x_servo:dead@20 or y_servo:gain=0.5@20-40"
    )]
    Shape(String),
    #[error("`{code}:{kind}` is not known; there are {known}", known = known())]
    Unknown { code: String, kind: String },
    #[error("`{word}` is not a size for {kind}: {expected}")]
    Size { word: String, kind: String, expected: &'static str },
    #[error("`{0}` is not a time or a span of times in seconds, as in 20 or 20-40")]
    Time(String),
}

/// Returns the names of all faults, for error messages.
pub(crate) fn known() -> String {
    let servo: Vec<_> = ServoFault::all().iter().map(ServoFault::name).collect();
    let ball: Vec<_> = BallFault::all().iter().map(BallFault::name).collect();
    let sensor: Vec<_> = SensorFault::all().iter().map(SensorFault::name).collect();
    let (servo, ball, sensor) = (servo.join(", "), ball.join(", "), sensor.join(", "));
    format!("x_servo or y_servo: {servo}; stuck_ball: {ball}; sensor: {sensor}")
}

impl FromStr for Fault {
    type Err = FaultSyntax;

    fn from_str(text: &str) -> Result<Self, FaultSyntax> {
        let shape = || FaultSyntax::Shape(text.to_owned());
        let (what, span) = text.split_once('@').ok_or_else(shape)?;
        let (code, kind) = what.split_once(':').ok_or_else(shape)?;
        let (kind, size) = match kind.split_once('=') {
            Some((kind, size)) => (kind, Some(size)),
            None => (kind, None),
        };
        let (onset_s, end_s) = span_s(span)?;
        Ok(Self { effect: effect(code, kind, size)?, onset_s, end_s })
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.effect.code(), self.effect.kind())?;
        if let Some(size) = self.effect.size() {
            let words: Vec<String> = size.iter().map(f64::to_string).collect();
            write!(f, "={}", words.join(","))?;
        }
        if let FaultEffect::Sensor(fault) = self.effect
            && let Some(axis) = fault.axis()
        {
            write!(f, "={}", axis.as_str())?;
        }
        write!(f, "@{}", self.onset_s)?;
        self.end_s.map_or(Ok(()), |end| write!(f, "-{end}"))
    }
}

fn span_s(text: &str) -> Result<(f64, Option<f64>), FaultSyntax> {
    let seconds = |word: &str| {
        let value: Option<f64> = word.trim_end_matches('s').parse().ok();
        value.filter(|v| v.is_finite() && *v >= 0.0)
    };
    let wrong = || FaultSyntax::Time(text.to_owned());
    let (onset, end) = match text.split_once('-') {
        Some((onset, end)) => (onset, Some(seconds(end).ok_or_else(wrong)?)),
        None => (text, None),
    };
    let onset = seconds(onset).ok_or_else(wrong)?;
    if end.is_some_and(|end| end <= onset) {
        return Err(wrong());
    }
    Ok((onset, end))
}

fn effect(code: &str, kind: &str, size: Option<&str>) -> Result<FaultEffect, FaultSyntax> {
    let unknown = || FaultSyntax::Unknown { code: code.to_owned(), kind: kind.to_owned() };
    let servo = |axis| {
        let fault = ServoFault::parse(kind, size)?;
        Some(fault.map(|fault| FaultEffect::Servo(axis, fault)))
    };
    let effect = match code.parse::<FaultCode>().map_err(|_| unknown())? {
        FaultCode::XServo => servo(Axis::X),
        FaultCode::YServo => servo(Axis::Y),
        FaultCode::StuckBall => BallFault::parse(kind, size).map(|f| f.map(FaultEffect::Ball)),
        FaultCode::Sensor => SensorFault::parse(kind, size).map(|f| f.map(FaultEffect::Sensor)),
    };
    effect.ok_or_else(unknown)?.map_err(|expected| FaultSyntax::Size {
        word: size.unwrap_or_default().to_owned(),
        kind: kind.to_owned(),
        expected,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_become_faults_and_back() {
        let fault: Fault = "y_servo:gain=0.5@20-40".parse().unwrap();
        assert_eq!(fault.effect, FaultEffect::Servo(Axis::Y, ServoFault::Gain(0.5)));
        assert_eq!((fault.onset_s, fault.end_s), (20.0, Some(40.0)));
        for text in [
            "x_servo:dead@20",
            "y_servo:gain=0.5@20-40",
            "sensor:jump=0.04,-0.01@3.5",
            "sensor:freeze_axis=y@1",
            "stuck_ball:sticky=0.1@2-3",
        ] {
            assert_eq!(text.parse::<Fault>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn the_diagnosis_words_are_understood_too() {
        let effect = |text: &str| text.parse::<Fault>().unwrap().effect;
        assert_eq!(effect("x_servo:held@1"), effect("x_servo:hold@1"));
        assert_eq!(effect("sensor:frozen@1"), effect("sensor:freeze@1"));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let error = |text: &str| text.parse::<Fault>().unwrap_err().to_string();
        assert!(error("x_servo").contains("CODE:KIND"));
        assert!(error("x_servo:tired@3").contains("`x_servo:tired` is not known"));
        assert!(error("x_servo:gain=big@3").contains("`big` is not a size for gain"));
        assert!(error("x_servo:dead=2@3").contains("it has none"));
        assert!(error("x_servo:dead@soon").contains("`soon` is not a time"));
        assert!(error("x_servo:dead@5-4").contains("`5-4`"));
        assert!(error("sensor:spikes=NaN@5").contains("0 to 1"));
    }

    #[test]
    fn a_fault_is_there_from_its_onset_to_before_its_end() {
        let fault: Fault = "x_servo:dead@2-3".parse().unwrap();
        assert_eq!([1.9, 2.0, 2.9, 3.0].map(|t| fault.active(t)), [false, true, true, false]);
    }
}
