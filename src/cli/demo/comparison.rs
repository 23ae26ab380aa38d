//! Compares injected faults with confirmed ones.

use offbd_wire::words::{CodeWord, StatusWord};
use std::io::Write;

use offbd_core::diagnosis::StatusByte;
use offbd_core::vocabulary::FaultCode;
use offbd_lab::simulation::FaultTruth;
use offbd_terminal::table;
use offbd_wire::verdict::FaultView;

/// An injected fault and its session.
#[derive(Clone, Debug)]
pub(super) struct Injected {
    pub session: String,
    pub truth: FaultTruth,
}

/// All injected and all confirmed faults.
#[derive(Clone, Debug, Default)]
pub(super) struct FaultComparison {
    injected: Vec<Injected>,
    found: Vec<FaultView>,
    /// Session and code of the confirmed faults whose test fails.
    failing: Vec<(String, CodeWord)>,
}

impl FaultComparison {
    pub(super) fn injected(&mut self, session: &str, truths: impl IntoIterator<Item = FaultTruth>) {
        let of_session = |truth| Injected { session: session.to_owned(), truth };
        self.injected.extend(truths.into_iter().map(of_session));
    }

    /// Records a fault transition. A confirmed fault counts when its test begins to fail, for
    /// the first time or again after it has passed or the fault was cleared.
    pub(super) fn heard(&mut self, fault: &FaultView) {
        let place = (fault.session.clone(), fault.code);
        let is_found = fault.status == StatusWord::Confirmed && fails(fault);
        if !is_found {
            self.failing.retain(|known| *known != place);
        } else if !self.failing.contains(&place) {
            self.failing.push(place);
            self.found.push(fault.clone());
        }
    }

    /// Returns whether every code of `codes` has been recorded for `session`.
    pub(super) fn has_heard(&self, session: &str, codes: &[CodeWord]) -> bool {
        let heard =
            |code: &CodeWord| self.found.iter().any(|f| f.session == session && f.code == *code);
        codes.iter().all(heard)
    }

    /// Returns whether `code` has been confirmed in any session so far.
    pub(super) fn has_found(&self, code: FaultCode) -> bool {
        self.found.iter().any(|f| f.code == code.into())
    }

    /// Returns whether every fault was confirmed after its onset, and nothing else.
    pub(super) fn agrees(&self) -> bool {
        self.injected.iter().all(|i| self.answer(i).is_some()) && self.unexplained().count() == 0
    }

    /// The first fault that was confirmed after `injected`, and before its code was injected
    /// again.
    fn answer(&self, injected: &Injected) -> Option<&FaultView> {
        let onset_s = |injected: &Injected| injected.truth.fault.onset_s;
        let same_code = |other: &&Injected| {
            other.session == injected.session
                && other.truth.fault.effect.code() == injected.truth.fault.effect.code()
        };
        let later = self.injected.iter().filter(same_code).map(onset_s);
        let next_s = later.filter(|s| *s > onset_s(injected)).fold(f64::INFINITY, f64::min);
        self.found.iter().find(|found| explains(injected, found) && found.t_s < next_s)
    }

    /// Returns the confirmed faults that were not injected.
    fn unexplained(&self) -> impl Iterator<Item = &FaultView> {
        self.found.iter().filter(|found| !self.injected.iter().any(|i| explains(i, found)))
    }

    /// Writes the comparison as a table.
    pub(super) fn write(&self, out: &mut impl Write) -> std::io::Result<()> {
        if self.injected.is_empty() && self.found.is_empty() {
            return writeln!(out, "nothing injected, nothing found");
        }
        let heading = ["injected", "onset", "found", "confirmed", "delay", "from 1st chance"];
        let mut rows = table::table(&heading, &[1, 3, 4, 5]);
        for injected in &self.injected {
            rows.add_row(self.row(injected));
        }
        for found in self.unexplained() {
            let at = format!("{:.2} s", found.t_s);
            let nothing = || "-".to_owned();
            rows.add_row([nothing(), nothing(), named(found), at, nothing(), nothing()]);
        }
        for line in table::lines(&rows) {
            writeln!(out, "{line}")?;
        }
        Ok(())
    }

    fn row(&self, injected: &Injected) -> [String; 6] {
        let truth = &injected.truth;
        let (effect, onset_s) = (&truth.fault.effect, truth.fault.onset_s);
        let words = format!("{}:{}", effect.code(), effect.kind());
        let onset = format!("{onset_s:.2} s");
        let Some(found) = self.answer(injected) else {
            let nothing = || "-".to_owned();
            return [words, onset, "not found".to_owned(), nothing(), nothing(), nothing()];
        };
        let since = |t: f64| format!("{:.2} s", (found.t_s - t).max(0.0));
        let chance = truth.chance_s.map_or_else(|| "-".to_owned(), since);
        [words, onset, named(found), format!("{:.2} s", found.t_s), since(onset_s), chance]
    }
}

fn explains(injected: &Injected, found: &FaultView) -> bool {
    let fault = &injected.truth.fault;
    found.session == injected.session
        && found.code == fault.effect.code().into()
        && found.t_s >= fault.onset_s
}

/// Returns whether the fault's test currently fails.
fn fails(fault: &FaultView) -> bool {
    let byte = u8::from_str_radix(&fault.status_byte, 16).map(StatusByte::from_bits);
    byte.is_ok_and(StatusByte::test_failed)
}

fn named(fault: &FaultView) -> String {
    fault.kind.map_or_else(|| fault.code.to_string(), |kind| format!("{} ({kind})", fault.code))
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::{Evidence, Suspicion, Transition};
    use offbd_core::vocabulary::{FaultStatus, SimTime};
    use offbd_lab::simulation::Fault;
    use offbd_wire::basis::Basis;
    use offbd_wire::verdict::fault_view;

    fn truth(words: &str) -> FaultTruth {
        FaultTruth { fault: words.parse::<Fault>().unwrap(), chance_s: Some(11.0) }
    }

    fn found(session: &str, code: FaultCode, t_s: f64, status: FaultStatus) -> FaultView {
        let at = SimTime::new(t_s).unwrap();
        let (mut byte, suspicion) = (StatusByte::default(), Suspicion::default());
        byte.failed();
        let evidence = Evidence::default();
        let transition = Transition { at, code, status, byte, suspicion, evidence };
        fault_view(session, &Basis::default(), &transition)
    }

    fn comparison(heard: &[FaultView]) -> FaultComparison {
        let mut comparison = FaultComparison::default();
        comparison.injected("a", [truth("x_servo:dead@10-20")]);
        heard.iter().for_each(|f| comparison.heard(f));
        comparison
    }

    #[test]
    fn a_fault_that_is_injected_again_is_found_again() {
        let at = |t_s, status| found("a", FaultCode::XServo, t_s, status);
        let first = at(11.0, FaultStatus::Confirmed);
        let cleared = at(20.0, FaultStatus::Cleared);
        let again = at(31.0, FaultStatus::Confirmed);
        let mut comparison = comparison(&[first.clone(), first.clone()]);
        comparison.injected("a", [truth("x_servo:dead@30")]);
        assert!(!comparison.agrees(), "the second one is not found yet");
        [cleared, again].iter().for_each(|fault| comparison.heard(fault));
        let answers = comparison.injected.iter().map(|i| comparison.answer(i).unwrap().t_s);
        assert_eq!(answers.collect::<Vec<_>>(), [11.0, 31.0]);
        assert!(comparison.agrees());
    }

    #[test]
    fn agreement_is_every_fault_found_after_its_onset_and_nothing_else() {
        use FaultCode::{Sensor, XServo};
        use FaultStatus::{Confirmed, Pending};
        let right = found("a", XServo, 13.0, Confirmed);
        assert!(comparison(std::slice::from_ref(&right)).agrees());
        assert!(!comparison(&[]).agrees(), "missed");
        assert!(!comparison(&[found("a", XServo, 13.0, Pending)]).agrees(), "only pending");
        assert!(!comparison(&[found("a", XServo, 9.0, Confirmed)]).agrees(), "too early");
        assert!(!comparison(&[found("b", XServo, 13.0, Confirmed)]).agrees(), "another session");
        let passes =
            FaultView { status_byte: "2C".to_owned(), ..found("b", XServo, 3.0, Confirmed) };
        assert!(comparison(&[right.clone(), passes]).agrees(), "on record from before");
        assert!(
            !comparison(&[right, found("a", Sensor, 14.0, Confirmed)]).agrees(),
            "one too many"
        );
    }

    #[test]
    fn the_table_has_both_delays() {
        let mut text = Vec::new();
        let right = found("a", FaultCode::XServo, 13.0, FaultStatus::Confirmed);
        comparison(&[right]).write(&mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let row: Vec<&str> = text.lines().nth(1).unwrap().split_whitespace().collect();
        assert_eq!(row.join(" "), "x_servo:dead 10.00 s x_servo 13.00 s 3.00 s 2.00 s");
    }
}
