//! Plans the faults of the demo and its sessions.
//!
//! A fault is repaired, and its session ends, before the next fault begins, so that every
//! fault occurs in a session that starts with a healthy rig.

use std::collections::VecDeque;

use offbd_core::vocabulary::Axis;
use offbd_lab::simulation::BallFault;
use offbd_lab::simulation::{Fault, FaultEffect, SensorFault, ServoFault};

/// One session of the demo: from `start_s` to `end_s` on the rig's clock.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Episode {
    pub start_s: f64,
    pub end_s: f64,
    pub faults: Vec<Fault>,
}

/// The default faults, in this order.
const SHOWN: [FaultEffect; 4] = [
    FaultEffect::Servo(Axis::X, ServoFault::Dead),
    FaultEffect::Ball(BallFault::Glued),
    FaultEffect::Sensor(SensorFault::Freeze),
    FaultEffect::Servo(Axis::Y, ServoFault::Dead),
];

/// Approximate interval between faults, s; chosen.
const SLOT_S: f64 = 30.0;
/// Time for which the rig of a demo without an end stays healthy, s of the visitor's time.
/// Chosen: enough to open the page, look at the rig and press a button first.
pub(super) const HEALTHY_FIRST_S: f64 = 60.0;
/// Onset of a fault as a share of its interval; chosen.
const ONSET_SHARE: f64 = 0.35;
/// Repair of a fault as a share of its interval; chosen.
const END_SHARE: f64 = 0.8;
/// Repair of a fault without an end, as a share of the time to the next onset; chosen.
const REPAIR_SHARE: f64 = 0.6;
/// Minimum time from a repair to the next onset for a new session, s. Chosen so that the
/// ball returns to the centre first; closer faults share a session.
const RECOVERY_S: f64 = 6.0;

/// Returns the default faults within `seconds`: at least two, each in its own interval.
pub(super) fn shown(seconds: f64) -> Vec<Fault> {
    let n = (seconds / SLOT_S).floor().max(2.0);
    let slot_s = seconds / n;
    let fault = |i: usize| {
        let at = |share: f64| (i as f64 + share) * slot_s;
        let effect = SHOWN[i % SHOWN.len()];
        Fault { effect, onset_s: at(ONSET_SHARE), end_s: Some(at(END_SHARE)) }
    };
    (0..n as usize).map(fault).collect()
}

/// Returns the default faults within `seconds`, the first one at `first_s`.
pub(super) fn shown_later(first_s: f64, seconds: f64) -> Vec<Fault> {
    let later_s = first_s - ONSET_SHARE * SLOT_S;
    let later = |fault: Fault| Fault {
        onset_s: fault.onset_s + later_s,
        end_s: fault.end_s.map(|end_s| end_s + later_s),
        ..fault
    };
    shown(seconds - later_s).into_iter().map(later).collect()
}

/// Divides `seconds` into sessions with `faults`.
pub(super) fn episodes(mut faults: Vec<Fault>, seconds: f64) -> Vec<Episode> {
    faults.retain(|f| f.onset_s < seconds);
    faults.sort_by(|a, b| a.onset_s.total_cmp(&b.onset_s));
    repair_before_the_next(&mut faults);
    let mut all = vec![Episode { start_s: 0.0, end_s: seconds, faults: Vec::new() }];
    for fault in faults {
        let whole_s = all.last().and_then(|e| e.faults.last()).and_then(|f| f.end_s);
        if let (Some(whole_s), Some(last)) = (whole_s, all.last_mut())
            && fault.onset_s - whole_s >= RECOVERY_S
        {
            last.end_s = f64::midpoint(whole_s, fault.onset_s);
            let start_s = last.end_s;
            all.push(Episode { start_s, end_s: seconds, faults: Vec::new() });
        }
        if let Some(last) = all.last_mut() {
            last.faults.push(fault);
        }
    }
    all
}

/// Adapts the episodes `rest` to a script that is resumed at `now_s`: drops those in the
/// past, and leaves at least one until `end_s`.
pub(super) fn go_on(rest: &mut VecDeque<Episode>, now_s: f64, end_s: f64) {
    rest.retain(|episode| episode.end_s > now_s);
    if rest.is_empty() && now_s < end_s {
        rest.push_back(Episode { start_s: now_s, end_s, faults: Vec::new() });
    }
    if let Some(first) = rest.front_mut() {
        first.start_s = now_s;
        first.faults.retain(|fault| fault.onset_s > now_s);
    }
}

fn repair_before_the_next(faults: &mut [Fault]) {
    for i in 1..faults.len() {
        let next_s = faults[i].onset_s;
        let before = &mut faults[i - 1];
        let repair_s = before.onset_s + REPAIR_SHARE * (next_s - before.onset_s);
        before.end_s = before.end_s.or(Some(repair_s).filter(|_| next_s > before.onset_s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(words: &[&str]) -> Vec<Fault> {
        words.iter().map(|w| w.parse().unwrap()).collect()
    }

    #[test]
    fn a_minute_shows_a_servo_and_a_ball_in_two_sessions() {
        let shown = episodes(shown(60.0), 60.0);
        assert_eq!(shown.len(), 2);
        assert_eq!((shown[0].start_s, shown[1].end_s), (0.0, 60.0));
        assert_eq!(shown[0].end_s, shown[1].start_s);
        let codes: Vec<_> = shown.iter().map(|e| e.faults[0].effect.code().as_str()).collect();
        assert_eq!(codes, ["x_servo", "stuck_ball"]);
        for episode in &shown {
            let fault = &episode.faults[0];
            assert!(fault.onset_s > episode.start_s + 3.0 && fault.onset_s < episode.end_s);
            assert!(fault.end_s.unwrap() <= episode.end_s);
        }
    }

    #[test]
    fn a_demo_without_an_end_begins_with_a_healthy_rig() {
        let later = shown_later(60.0, 86_400.0);
        let codes: Vec<_> = later[..2].iter().map(|f| f.effect.code().as_str()).collect();
        assert_eq!(codes, ["x_servo", "stuck_ball"]);
        assert!((later[0].onset_s - 60.0).abs() < 0.1, "{:?}", later[0]);
        assert!(later.iter().all(|f| f.end_s.is_some_and(|end_s| end_s > f.onset_s)));
        assert!(later.last().unwrap().end_s.unwrap() < 86_400.0);
    }

    #[test]
    fn a_fault_is_repaired_before_the_next_and_close_ones_share_a_session() {
        let far = episodes(faults(&["y_servo:dead@30", "x_servo:dead@10"]), 60.0);
        assert_eq!(far.len(), 2);
        assert_eq!(far[0].faults[0].end_s, Some(22.0));
        assert_eq!((far[0].end_s, far[1].faults[0].end_s), (26.0, None));
        let close = episodes(faults(&["x_servo:dead@10-20", "y_servo:dead@21"]), 60.0);
        assert_eq!(close.len(), 1);
        assert_eq!(close[0].faults.len(), 2);
    }

    #[test]
    fn after_a_break_the_script_goes_on_with_what_is_to_come() {
        let planned = episodes(faults(&["x_servo:dead@10-20", "y_servo:dead@40-50"]), 60.0);
        let mut rest = VecDeque::from(planned.clone());
        go_on(&mut rest, 15.0, 60.0);
        assert_eq!((rest.len(), rest[0].start_s, rest[0].faults.len()), (2, 15.0, 0));
        go_on(&mut rest, 35.0, 60.0);
        assert_eq!((rest.len(), rest[0].start_s, &rest[0].faults), (1, 35.0, &planned[1].faults));
        rest.clear();
        go_on(&mut rest, 55.0, 60.0);
        assert_eq!(rest, [Episode { start_s: 55.0, end_s: 60.0, faults: vec![] }]);
        rest.clear();
        go_on(&mut rest, 60.0, 60.0);
        assert!(rest.is_empty());
    }

    #[test]
    fn no_fault_is_one_session_and_late_faults_are_left_out() {
        let healthy = episodes(faults(&["x_servo:dead@90"]), 60.0);
        assert_eq!(healthy, [Episode { start_s: 0.0, end_s: 60.0, faults: vec![] }]);
    }
}
