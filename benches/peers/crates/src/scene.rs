//! The scenes: how the plate moves, for how long, and how hard the contact is.

use std::f64::consts::PI;

/// How the plate moves.
#[derive(Clone, Copy, PartialEq)]
pub enum Law {
    Slope,
    Sine,
    Steep,
}

/// Angles, rates and accelerations about x and y, in rad, rad/s and rad/s².
#[derive(Clone, Copy)]
pub struct Motion {
    pub angle: [f64; 2],
    pub rate: [f64; 2],
    pub acceleration: [f64; 2],
}

impl Law {
    /// The plate's motion at `t`.
    #[inline]
    pub fn at(self, t: f64) -> Motion {
        match self {
            Self::Slope => Motion { angle: [PI / 20.0; 2], rate: [0.0; 2], acceleration: [0.0; 2] },
            Self::Sine => sine(t),
            Self::Steep => steep(t),
        }
    }
}

#[inline]
fn sine(t: f64) -> Motion {
    const AMPLITUDE: f64 = 0.05;
    let frequency = [2.0 * PI * 0.7, 2.0 * PI * 0.9];
    let phase = [frequency[0] * t, frequency[1] * t + 0.5].map(f64::sin_cos);
    let each = |f: &dyn Fn(usize) -> f64| [AMPLITUDE * f(0), AMPLITUDE * f(1)];
    Motion {
        angle: each(&|i| phase[i].0),
        rate: each(&|i| frequency[i] * phase[i].1),
        acceleration: each(&|i| -frequency[i] * frequency[i] * phase[i].0),
    }
}

#[inline]
fn steep(t: f64) -> Motion {
    const RISE: f64 = 0.15;
    const ANGLE: f64 = 1.2;
    let u = (t / RISE).min(1.0);
    let acceleration = if u < 1.0 { (6.0 - 12.0 * u) * ANGLE / (RISE * RISE) } else { 0.0 };
    Motion {
        angle: [0.0, ANGLE * u * u * (3.0 - 2.0 * u)],
        rate: [0.0, 6.0 * u * (1.0 - u) * ANGLE / RISE],
        acceleration: [0.0, acceleration],
    }
}

/// Spring (N/m) and damper (N·s/m) of a contact.
#[derive(Clone, Copy)]
pub struct Contact {
    pub stiffness: f64,
    pub damping: f64,
}

const HARD: Contact = Contact { stiffness: 800_000.0, damping: 1000.0 };
const SOFT: Contact = Contact { stiffness: 1000.0, damping: 100.0 };

/// One scene.
#[derive(Clone, Copy)]
pub struct Scene {
    pub name: &'static str,
    pub law: Law,
    pub duration: f64,
    pub contact: Contact,
    pub quick: bool,
}

/// All scenes.
pub const SCENES: [Scene; 6] = [
    Scene { name: "slope", law: Law::Slope, duration: 0.4, contact: HARD, quick: false },
    Scene { name: "sine", law: Law::Sine, duration: 10.0, contact: HARD, quick: true },
    Scene { name: "steep", law: Law::Steep, duration: 0.4, contact: HARD, quick: true },
    Scene { name: "slope-soft", law: Law::Slope, duration: 0.4, contact: SOFT, quick: false },
    Scene { name: "sine-soft", law: Law::Sine, duration: 10.0, contact: SOFT, quick: false },
    Scene { name: "steep-soft", law: Law::Steep, duration: 0.4, contact: SOFT, quick: false },
];
