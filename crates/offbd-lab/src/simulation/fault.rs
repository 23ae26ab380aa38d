//! The faults of a simulated rig, and their syntax on the command line:
//! `CODE:KIND[=SIZE]@START[-END]`, as in `y_servo:gain=0.5@20-40`.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;

use offbd_core::vocabulary::{Axis, FaultCode};

/// A fault of a servo. Angles are those of the plate that it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServoFault {
    /// The servo stays at its angle.
    Hold,
    /// The servo loses power, and a spring returns it to zero.
    Dead,
    /// The angle is the command times this factor.
    Gain(f64),
    /// The angle has the wrong sign.
    Reversed,
    /// The horn has slipped: the angle is off by a constant, rad.
    Offset(f64),
    /// The lag is longer and the rate limit lower by this factor.
    Slow(f64),
    /// A loose contact interrupts the power intermittently.
    Intermittent,
}

/// A fault of the ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BallFault {
    /// The ball is fixed to the plate.
    Glued,
    /// The ball moves only at a tilt above this, rad.
    Sticky(f64),
}

/// A fault of the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SensorFault {
    /// The sensor repeats its last reading.
    Freeze,
    /// The sensor repeats its last reading of one axis.
    FreezeAxis(Axis),
    /// Readings are missing, with this probability.
    Dropout(f64),
    /// The noise is larger by this factor.
    Noise(f64),
    /// Readings are outliers, with this probability.
    Spikes(f64),
    /// Readings are shifted by a constant, m.
    Jump(Vector2<f64>),
}

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
            Self::Servo(_, ServoFault::Hold) => "hold",
            Self::Servo(_, ServoFault::Dead) => "dead",
            Self::Servo(_, ServoFault::Gain(_)) => "gain",
            Self::Servo(_, ServoFault::Reversed) => "reversed",
            Self::Servo(_, ServoFault::Offset(_)) => "offset",
            Self::Servo(_, ServoFault::Slow(_)) => "slow",
            Self::Servo(_, ServoFault::Intermittent) => "intermittent",
            Self::Ball(BallFault::Glued) => "glued",
            Self::Ball(BallFault::Sticky(_)) => "sticky",
            Self::Sensor(SensorFault::Freeze) => "freeze",
            Self::Sensor(SensorFault::FreezeAxis(_)) => "freeze_axis",
            Self::Sensor(SensorFault::Dropout(_)) => "dropout",
            Self::Sensor(SensorFault::Noise(_)) => "noise",
            Self::Sensor(SensorFault::Spikes(_)) => "spikes",
            Self::Sensor(SensorFault::Jump(_)) => "jump",
        }
    }

    /// Returns the axis of the fault; `None` if it is not on one axis.
    #[must_use]
    pub const fn axis(&self) -> Option<Axis> {
        match self {
            Self::Servo(axis, _) | Self::Sensor(SensorFault::FreezeAxis(axis)) => Some(*axis),
            Self::Ball(_) | Self::Sensor(_) => None,
        }
    }

    /// Returns the size: a factor, an angle in rad, a probability or a shift in m; `None`
    /// if the fault has none. A dropout's probability is not returned.
    #[must_use]
    pub fn size(&self) -> Option<Vec<f64>> {
        match *self {
            Self::Servo(_, ServoFault::Gain(size) | ServoFault::Offset(size))
            | Self::Servo(_, ServoFault::Slow(size))
            | Self::Ball(BallFault::Sticky(size))
            | Self::Sensor(SensorFault::Noise(size) | SensorFault::Spikes(size)) => {
                Some(vec![size])
            }
            Self::Sensor(SensorFault::Jump(shift)) => Some(vec![shift.x, shift.y]),
            _ => None,
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
    #[error("`{code}:{kind}` is not known; there are {known}", known = KNOWN)]
    Unknown { code: String, kind: String },
    #[error("`{word}` is not a size for {kind}: {expected}")]
    Size { word: String, kind: String, expected: &'static str },
    #[error("`{0}` is not a time or a span of times in seconds, as in 20 or 20-40")]
    Time(String),
}

/// The names of all faults, for error messages.
pub(crate) const KNOWN: &str = "x_servo or y_servo: hold, dead, gain, reversed, offset, slow, \
     intermittent; stuck_ball: glued, sticky; sensor: freeze, freeze_axis, dropout, noise, \
     spikes, jump";

/// Default sizes. Chosen: clear faults, each well inside the range of the corpus of
/// recorded faults (gain 0.2–0.5, 3°, 12 times slower, 12 times noisier).
mod typical {
    /// Factor of the angle.
    pub(super) const GAIN: f64 = 0.4;
    /// Angle of a slipped horn, rad.
    pub(super) const OFFSET_RAD: f64 = 0.05;
    /// Factor of the lag.
    pub(super) const SLOW: f64 = 12.0;
    /// Breakaway tilt of a sticky ball, rad.
    pub(super) const STICKY_RAD: f64 = 0.1;
    /// Factor of the noise.
    pub(super) const NOISE: f64 = 12.0;
    /// Share of outliers.
    pub(super) const SPIKES: f64 = 0.2;
    /// Shift of the readings along x and y, m.
    pub(super) const JUMP_M: [f64; 2] = [0.035, -0.02];
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
        match (self.effect.size(), self.effect) {
            (Some(size), _) => {
                let words: Vec<String> = size.iter().map(f64::to_string).collect();
                write!(f, "={}", words.join(","))?;
            }
            (None, FaultEffect::Sensor(SensorFault::FreezeAxis(axis))) => {
                write!(f, "={}", axis.as_str())?;
            }
            _ => {}
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
    let size = SizeWord { kind, word: size };
    let effect = match code.parse::<FaultCode>().map_err(|_| unknown())? {
        FaultCode::XServo => servo(kind, &size)?.map(|e| FaultEffect::Servo(Axis::X, e)),
        FaultCode::YServo => servo(kind, &size)?.map(|e| FaultEffect::Servo(Axis::Y, e)),
        FaultCode::StuckBall => ball(kind, &size)?.map(FaultEffect::Ball),
        FaultCode::Sensor => sensor(kind, &size)?.map(FaultEffect::Sensor),
    };
    effect.ok_or_else(unknown)
}

fn servo(kind: &str, size: &SizeWord<'_>) -> Result<Option<ServoFault>, FaultSyntax> {
    Ok(Some(match kind {
        "hold" | "held" => size.none(ServoFault::Hold)?,
        "dead" => size.none(ServoFault::Dead)?,
        "gain" => ServoFault::Gain(size.number(typical::GAIN, -5.0, 5.0, "a factor, -5 to 5")?),
        "reversed" => size.none(ServoFault::Reversed)?,
        "offset" => ServoFault::Offset(size.number(
            typical::OFFSET_RAD,
            -1.0,
            1.0,
            "an angle in rad, -1 to 1",
        )?),
        "slow" => {
            ServoFault::Slow(size.number(typical::SLOW, 1.0, 1000.0, "a factor, 1 to 1000")?)
        }
        "intermittent" => size.none(ServoFault::Intermittent)?,
        _ => return Ok(None),
    }))
}

fn ball(kind: &str, size: &SizeWord<'_>) -> Result<Option<BallFault>, FaultSyntax> {
    Ok(Some(match kind {
        "glued" | "stuck" => size.none(BallFault::Glued)?,
        "sticky" => BallFault::Sticky(size.number(
            typical::STICKY_RAD,
            0.0,
            1.5,
            "a breakaway tilt in rad, 0 to 1.5",
        )?),
        _ => return Ok(None),
    }))
}

fn sensor(kind: &str, size: &SizeWord<'_>) -> Result<Option<SensorFault>, FaultSyntax> {
    let share = |typical| size.number(typical, 0.0, 1.0, "a share of the readings, 0 to 1");
    Ok(Some(match kind {
        "freeze" | "frozen" => size.none(SensorFault::Freeze)?,
        "freeze_axis" => SensorFault::FreezeAxis(size.axis()?),
        "dropout" => SensorFault::Dropout(share(1.0)?),
        "noise" => {
            let factor = size.number(typical::NOISE, 1.0, 1000.0, "a factor, 1 to 1000")?;
            SensorFault::Noise(factor)
        }
        "spikes" => SensorFault::Spikes(share(typical::SPIKES)?),
        "jump" => SensorFault::Jump(size.shift()?),
        _ => return Ok(None),
    }))
}

/// The word after `=`, if any.
struct SizeWord<'a> {
    kind: &'a str,
    word: Option<&'a str>,
}

impl SizeWord<'_> {
    fn wrong(&self, expected: &'static str) -> FaultSyntax {
        let word = self.word.unwrap_or_default().to_owned();
        FaultSyntax::Size { word, kind: self.kind.to_owned(), expected }
    }

    fn none<T>(&self, effect: T) -> Result<T, FaultSyntax> {
        self.word.map_or(Ok(effect), |_| Err(self.wrong("it has none")))
    }

    fn number(
        &self,
        typical: f64,
        least: f64,
        most: f64,
        expected: &'static str,
    ) -> Result<f64, FaultSyntax> {
        let Some(word) = self.word else { return Ok(typical) };
        let value: Option<f64> = word.parse().ok();
        value.filter(|v| (least..=most).contains(v)).ok_or_else(|| self.wrong(expected))
    }

    fn axis(&self) -> Result<Axis, FaultSyntax> {
        match self.word {
            Some("x") | None => Ok(Axis::X),
            Some("y") => Ok(Axis::Y),
            Some(_) => Err(self.wrong("x or y")),
        }
    }

    fn shift(&self) -> Result<Vector2<f64>, FaultSyntax> {
        let Some(word) = self.word else { return Ok(typical::JUMP_M.into()) };
        let (x, y) = word.split_once(',').unwrap_or((word, "0"));
        let metres = |word: &str| {
            let value: Option<f64> = word.parse().ok();
            let expected = "a shift in m along x, or along x and y as in 0.04,-0.02";
            value.filter(|v| v.abs() <= 10.0).ok_or_else(|| self.wrong(expected))
        };
        Ok(Vector2::new(metres(x)?, metres(y)?))
    }
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
