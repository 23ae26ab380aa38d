//! The faults that can be injected: a row for each, with its size, its name and the word of
//! the diagnosis if that is another one; and what a fault does.
//!
//! The default sizes are chosen: clear faults, each well inside the range of the corpus of
//! recorded faults (gain 0.2–0.5, 3°, 12 times slower, 12 times noisier).

use nalgebra::Vector2;

use super::size::{Number, OneAxis, Shift, Size as _, factor, number, share};
use crate::simulation::steps::rounded;
use offbd_core::vocabulary::{Axis, PerAxis};

/// Defines the faults of a component.
macro_rules! injections {
    ($(#[$doc:meta])* $name:ident { $(
        $(#[$vdoc:meta])*
        $variant:ident $(($size:ident: $type:ty = $known:expr))? = $word:literal
        $(| $also:literal)?
    ),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum $name { $($(#[$vdoc])* $variant $(($type))?),+ }

        impl $name {
            /// Returns every fault, with its default size.
            #[must_use]
            pub fn all() -> Vec<Self> {
                let named = |name: &&str| Self::parse(name, None)?.ok();
                [$($word),+].iter().filter_map(named).collect()
            }

            /// Returns the names of all faults, with their sizes, as in `gain=FACTOR`.
            #[must_use]
            pub fn usages() -> Vec<String> {
                vec![$([$word $(, $known.usage())?].concat()),+]
            }

            /// Returns the name, as on the command line.
            pub(super) const fn name(&self) -> &'static str {
                match self { $(Self::$variant { .. } => $word),+ }
            }

            /// Returns the size as numbers; `None` if it has none, or it is not told.
            pub(super) fn numbers(&self) -> Option<Vec<f64>> {
                match *self {
                    $(Self::$variant $(($size))? => None $(.or($known.numbers($size)))?),+
                }
            }

            /// Returns the axis; `None` if the fault is not on one axis.
            pub(super) fn axis(&self) -> Option<Axis> {
                match *self { $(Self::$variant $(($size))? => None $(.or($known.axis($size)))?),+ }
            }

            /// Returns the fault with this name and the size after `=`; `None` if there is no
            /// such fault. The error says what size is expected.
            pub(super) fn parse(
                name: &str,
                size: Option<&str>,
            ) -> Option<Result<Self, &'static str>> {
                match name {
                    $($word $(| $also)? => Some(injections!(@ size, Self::$variant $(, $known)?)),)+
                    _ => None,
                }
            }
        }
    };
    (@ $size:ident, $fault:path) => {
        $size.map_or(Ok($fault), |_| Err("it has none"))
    };
    (@ $size:ident, $fault:path, $known:expr) => {
        $known.parse($size).map($fault)
    };
}

injections! {
    /// A fault of a servo. Angles are those of the plate that it turns.
    ServoFault {
        /// The servo stays at its angle.
        Hold = "hold" | "held",
        /// The servo loses power, and a spring returns it to zero.
        Dead = "dead",
        /// The angle is the command times this factor.
        Gain(size: f64 = number(0.4, -5.0..=5.0, "a factor, -5 to 5", "=FACTOR")) = "gain",
        /// The angle has the wrong sign.
        Reversed = "reversed",
        /// The horn has slipped: the angle is off by a constant, rad.
        Offset(size: f64 = number(0.05, -1.0..=1.0, "an angle in rad, -1 to 1", "=RAD"))
            = "offset",
        /// The lag is longer and the rate limit lower by this factor.
        Slow(size: f64 = factor(12.0)) = "slow",
        /// A loose contact interrupts the power intermittently.
        Intermittent = "intermittent",
    }
}

injections! {
    /// A fault of the ball.
    BallFault {
        /// The ball is fixed to the plate.
        Glued = "glued" | "stuck",
        /// The ball moves only at a tilt above this, rad.
        Sticky(size: f64 = number(0.1, 0.0..=1.5, "a breakaway tilt in rad, 0 to 1.5", "=RAD"))
            = "sticky",
    }
}

injections! {
    /// A fault of the readings.
    SensorFault {
        /// The sensor repeats its last reading.
        Freeze = "freeze" | "frozen",
        /// The sensor repeats its last reading of one axis.
        FreezeAxis(size: Axis = OneAxis) = "freeze_axis",
        /// Readings are missing, with this probability.
        Dropout(size: f64 = Number { is_told: false, ..share(1.0) }) = "dropout",
        /// The noise is larger by this factor.
        Noise(size: f64 = factor(12.0)) = "noise",
        /// Readings are outliers, with this probability.
        Spikes(size: f64 = share(0.2)) = "spikes",
        /// Readings are shifted by a constant, m.
        Jump(size: Vector2<f64> = Shift([0.035, -0.02])) = "jump",
    }
}

/// What a servo does at one moment.
pub(in crate::simulation) struct HornDrive {
    /// The target of the horn, rad; `None`: it stays where it is.
    pub target: Option<f64>,
    /// Ratio of the lag to the healthy one, and of the healthy rate limit to this one.
    pub slower: f64,
    /// Angle by which the horn has slipped, rad.
    pub slip: f64,
}

impl HornDrive {
    /// A healthy servo.
    pub(in crate::simulation) const fn to(command: f64) -> Self {
        Self { target: Some(command), slower: 1.0, slip: 0.0 }
    }
}

impl ServoFault {
    /// Returns what a servo with this fault does when `command` is in force. `contact` returns
    /// whether a loose contact holds.
    pub(in crate::simulation) fn drive(
        self,
        command: f64,
        contact: impl FnOnce() -> bool,
    ) -> HornDrive {
        let healthy = HornDrive::to(command);
        match self {
            Self::Hold => HornDrive { target: None, ..healthy },
            Self::Dead => HornDrive::to(0.0),
            Self::Gain(factor) => HornDrive::to(factor * command),
            Self::Reversed => HornDrive::to(-command),
            Self::Offset(slip) => HornDrive { slip, ..healthy },
            Self::Slow(slower) => HornDrive { slower, ..healthy },
            Self::Intermittent => HornDrive { target: contact().then_some(command), ..healthy },
        }
    }
}

/// A reading, m per axis; `None` if no ball is seen.
pub(in crate::simulation) type Reading = PerAxis<Option<f64>>;

/// One look of the sensor, with the random numbers of all faults.
pub(in crate::simulation) struct SensorLook {
    pub healthy: Reading,
    /// The last reading with a ball.
    pub last: Reading,
    /// Uniformly distributed from 0 to 1.
    pub chance: f64,
    /// A deviation of the readings, m.
    pub noise_m: PerAxis<f64>,
    /// Distance of an outlier, m.
    pub far_m: PerAxis<f64>,
    pub quantum_m: f64,
}

impl SensorLook {
    fn shifted(&self, by: impl Fn(Axis) -> f64) -> Reading {
        PerAxis::from_fn(|a| self.healthy[a].map(|m| rounded(m + by(a), self.quantum_m)))
    }
}

impl SensorFault {
    /// Returns the reading of a sensor with this fault.
    pub(in crate::simulation) fn read(self, look: &SensorLook) -> Reading {
        match self {
            Self::Freeze => look.last,
            Self::FreezeAxis(axis) => {
                let mut reading = look.healthy;
                reading[axis] = look.last[axis];
                reading
            }
            Self::Dropout(share) if look.chance < share => Reading::default(),
            Self::Noise(factor) => look.shifted(|a| look.noise_m[a] * factor),
            Self::Spikes(share) if look.chance < share => look.shifted(|a| look.far_m[a]),
            Self::Jump(by) => look.shifted(|a| by[a as usize]),
            Self::Dropout(_) | Self::Spikes(_) => look.healthy,
        }
    }

    /// Returns how far readings are off because of this fault, m, if they are off by `off_m`
    /// along an axis; `None` if the fault shows at once.
    pub(in crate::simulation) fn hidden_m(self, off_m: impl Fn(Axis) -> f64) -> Option<f64> {
        match self {
            Self::Freeze => Some(off_m(Axis::X).hypot(off_m(Axis::Y))),
            Self::FreezeAxis(axis) => Some(off_m(axis)),
            Self::Dropout(_) | Self::Noise(_) | Self::Spikes(_) | Self::Jump(_) => None,
        }
    }
}
