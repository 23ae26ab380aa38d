//! The outlier gate of one axis: is this reading where a ball can be?
//!
//! A lone reading far off is refused. When readings stay there they are
//! believed, and the step is reported: no ball moves like that.

/// Fastest that a ball crosses a plate, m/s: a rim-to-rim roll over 0.4 m at
/// 10° ends at 1 m/s; hands push at less.
const FASTEST_M_S: f64 = 1.5;

/// Standard deviations of the noise that are always allowed.
const NOISE_FACTOR: f64 = 8.0;

/// Readings in a row, and seconds, that make a new place believable.
const BELIEVED_AFTER: u32 = 3;
const BELIEVED_AFTER_S: f64 = 0.06;

/// What became of a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gated {
    Accepted,
    /// An outlier: not to be used.
    Refused,
    /// Accepted after all, a step of this size, m, away from the last one.
    Stepped(f64),
}

#[derive(Clone, Copy, Debug)]
struct Elsewhere {
    since_s: f64,
    at_s: f64,
    position_m: f64,
    n: u32,
}

/// The gate.
#[derive(Clone, Copy, Debug, Default)]
pub struct OutlierGate {
    last: Option<(f64, f64)>,
    elsewhere: Option<Elsewhere>,
}

impl OutlierGate {
    /// Judges the reading `position_m` at `t_s` on a sensor with `noise_m`.
    pub fn take(&mut self, t_s: f64, position_m: f64, noise_m: f64) -> Gated {
        let reach = |from_s: f64| NOISE_FACTOR * noise_m + FASTEST_M_S * (t_s - from_s);
        let Some((last_s, last_m)) = self.last else {
            return self.accept(t_s, position_m);
        };
        if (position_m - last_m).abs() <= reach(last_s) {
            return self.accept(t_s, position_m);
        }
        let stays = |e: &Elsewhere| (position_m - e.position_m).abs() <= reach(e.at_s);
        let (since_s, n) = match self.elsewhere.filter(stays) {
            Some(e) => (e.since_s, e.n + 1),
            None => (t_s, 1),
        };
        if n >= BELIEVED_AFTER && t_s - since_s >= BELIEVED_AFTER_S {
            self.accept(t_s, position_m);
            return Gated::Stepped(position_m - last_m);
        }
        self.elsewhere = Some(Elsewhere { since_s, at_s: t_s, position_m, n });
        Gated::Refused
    }

    /// Forgets where the ball was, as after a gap.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    fn accept(&mut self, t_s: f64, position_m: f64) -> Gated {
        self.last = Some((t_s, position_m));
        self.elsewhere = None;
        Gated::Accepted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lone_readings_are_refused_and_steps_believed_later() {
        let mut gate = OutlierGate::default();
        let mut take = |i: u32, x: f64| gate.take(f64::from(i) * 0.02, x, 1e-3);
        assert_eq!(take(0, 0.0), Gated::Accepted);
        assert_eq!(take(1, 0.1), Gated::Refused);
        assert_eq!(take(2, 0.001), Gated::Accepted);
        for i in 3..6 {
            assert_eq!(take(i, 0.2), Gated::Refused);
        }
        assert_eq!(take(6, 0.2), Gated::Stepped(0.199));
        assert_eq!(take(7, 0.2), Gated::Accepted);
    }
}
