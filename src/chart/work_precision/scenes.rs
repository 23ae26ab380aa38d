//! The charted scenes: a constant slope, two sines, and a plate that turns so
//! steep that the ball slips, flies and lands; each on a hard and a soft contact.

use crate::scene::{Laws, Scene};
use crate::vocabulary::Invalid;
use crate::wire::scene::parse;

/// A scene with its drive.
pub(super) struct Charted {
    pub name: String,
    pub scene: Scene,
    pub laws: Laws,
}

macro_rules! file {
    ($name:literal) => {
        include_str!(concat!("../../../examples/scenes/", $name, ".json"))
    };
}

const FILES: [&str; 6] = [
    file!("slope"),
    file!("sine"),
    file!("steep"),
    file!("slope-soft"),
    file!("sine-soft"),
    file!("steep-soft"),
];

/// All of them, or the first.
pub(super) fn charted(quick: bool) -> Result<Vec<Charted>, Invalid> {
    let files = if quick { &FILES[..1] } else { &FILES[..] };
    files.iter().map(|file| of(file)).collect()
}

fn of(file: &str) -> Result<Charted, Invalid> {
    let named = parse(file.as_bytes())?;
    Ok(Charted { name: named.name, scene: named.scene, laws: named.laws })
}
