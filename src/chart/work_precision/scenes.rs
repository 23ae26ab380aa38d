//! The charted scenes: a constant slope, two sines, and a plate that turns so
//! steep that the ball slips, flies and lands; each on a hard and a soft contact.

use std::f64::consts::PI;

use crate::plant::{Ball, Contact, Plate};
use crate::scene::{Law, Laws, Scene, Subject, Term};
use crate::vocabulary::Invalid;

/// A scene with its drive.
pub(super) struct Charted {
    pub name: String,
    pub scene: Scene,
    pub laws: Laws,
}

/// All of them, or the quick two.
pub(super) fn charted(quick: bool) -> Result<Vec<Charted>, Invalid> {
    let contacts = [("", Contact::CHAPTER), ("-soft", Contact::SOFT)];
    let all = contacts.into_iter().flat_map(|(suffix, contact)| {
        ["slope", "sine", "steep"].map(|name| (name, suffix, contact))
    });
    all.filter(|(name, suffix, _)| !quick || (*name != "sine" && suffix.is_empty()))
        .map(|(name, suffix, contact)| of(name, suffix, contact))
        .collect()
}

fn of(name: &str, suffix: &str, contact: Contact) -> Result<Charted, Invalid> {
    let sine = |frequency, phase| Term::Sine { amplitude: 0.05, frequency, phase };
    let (qx, qy, duration_s) = match name {
        "slope" => (Term::Constant(PI / 20.0), Term::Constant(PI / 20.0), 0.4),
        "sine" => (sine(0.7, 0.0), sine(0.9, 0.5), 10.0),
        _ => {
            let steep = Term::Smoothstep { to: 1.2, start: 0.0, duration: 0.15 };
            (Term::Constant(0.0), steep, 0.4)
        }
    };
    let subject = Subject::Ball(Ball::default());
    let scene = Scene::new(subject, Plate::default(), contact, duration_s)?;
    let laws = Laws::new(Law::new(&[qx]), Law::new(&[qy]), Vec::new());
    Ok(Charted { name: format!("{name}{suffix}"), scene, laws })
}
