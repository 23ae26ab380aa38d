//! Computes a score from the label and the first confirmed fault of each session.

use std::collections::BTreeMap;

use serde::Serialize;

use super::Label;
use crate::labels::LabelledFault;

/// The first confirmed fault of a session.
#[derive(Clone, Debug)]
pub(super) struct FirstConfirmed {
    pub code: String,
    pub kind: Option<String>,
    pub t_s: f64,
}

/// The score of a corpus. Rates are shares of the faulty sessions.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct ScoreReport {
    /// Time without a fault, h: healthy sessions, and faulty ones up to the onset.
    pub healthy_hours: f64,
    /// Confirmed faults in healthy sessions or before the onset.
    pub false_alarms: u64,
    pub faulty_sessions: u64,
    pub detected: u64,
    pub detection_rate: Option<f64>,
    pub within_2s: Option<f64>,
    pub within_5s: Option<f64>,
    /// Number of faults detected with the correct code.
    pub isolated_right: u64,
    pub isolation_rate: Option<f64>,
    pub detected_and_right: Option<f64>,
    /// Median delay from the fault's first chance, s.
    pub delay_median_s: Option<f64>,
    pub delay_p90_s: Option<f64>,
    pub delay_from_onset_median_s: Option<f64>,
    /// Number of faults that never became detectable and were not detected; excluded.
    pub no_chance: u64,
    pub by_kind: BTreeMap<String, KindScore>,
    /// Sessions by `truth -> found`.
    pub matrix: BTreeMap<String, u64>,
}

/// The score of one kind of fault.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct KindScore {
    pub n: u64,
    pub detected: u64,
    pub right: u64,
    pub delay_median_s: Option<f64>,
}

/// A fault that was detected.
#[derive(Clone, Debug)]
struct Detection {
    kind: String,
    delay_s: f64,
    from_onset_s: f64,
    right: bool,
}

/// Counts over the sessions.
#[derive(Debug, Default)]
struct ScoreCounts {
    healthy_s: f64,
    false_alarms: u64,
    no_chance: u64,
    /// Number of faulty sessions that count, by kind.
    kinds: BTreeMap<String, u64>,
    detections: Vec<Detection>,
    matrix: BTreeMap<String, u64>,
}

/// Computes the score over sessions with their labels and first confirmed faults.
pub(super) fn figures<'a>(
    sessions: impl Iterator<Item = (&'a Label, Option<&'a FirstConfirmed>)>,
) -> ScoreReport {
    let mut tally = ScoreCounts::default();
    for (label, found) in sessions {
        match &label.fault {
            None => tally.healthy(label, found),
            Some(fault) => tally.faulty(label, fault, found),
        }
    }
    tally.figures()
}

impl ScoreCounts {
    fn count(&mut self, truth: &str, found: &str) {
        *self.matrix.entry(format!("{truth} -> {found}")).or_default() += 1;
    }

    fn healthy(&mut self, label: &Label, found: Option<&FirstConfirmed>) {
        self.healthy_s += label.seconds;
        self.false_alarms += u64::from(found.is_some());
        self.count("healthy", found.map_or("none", |f| f.code.as_str()));
    }

    fn faulty(&mut self, label: &Label, fault: &LabelledFault, found: Option<&FirstConfirmed>) {
        self.healthy_s += fault.onset_s;
        if found.is_none() && fault.chance_s.is_none() {
            self.no_chance += 1;
            return;
        }
        *self.kinds.entry(fault.kind.clone()).or_default() += 1;
        match found {
            None => self.count(&label.class, "none"),
            Some(found) if found.t_s < fault.onset_s => {
                self.false_alarms += 1;
                self.count(&label.class, "early");
            }
            Some(found) => self.detected(label, fault, found),
        }
    }

    fn detected(&mut self, label: &Label, fault: &LabelledFault, found: &FirstConfirmed) {
        let right = found.code == label.class || label.also.contains(&found.code);
        self.count(&label.class, if right { &label.class } else { &found.code });
        self.detections.push(Detection {
            kind: fault.kind.clone(),
            delay_s: (found.t_s - fault.chance_s.unwrap_or(fault.onset_s)).max(0.0),
            from_onset_s: found.t_s - fault.onset_s,
            right,
        });
    }

    fn figures(self) -> ScoreReport {
        let n: u64 = self.kinds.values().sum();
        let share = |part: usize, of: u64| (of > 0).then(|| rounded(part as f64 / of as f64, 4));
        let delays = sorted(self.detections.iter().map(|d| d.delay_s));
        let from_onset = sorted(self.detections.iter().map(|d| d.from_onset_s));
        let within = |limit_s: f64| share(delays.iter().filter(|d| **d <= limit_s).count(), n);
        let (detected, right) = (delays.len(), self.detections.iter().filter(|d| d.right).count());
        let by_kind = self.by_kind();
        ScoreReport {
            healthy_hours: rounded(self.healthy_s / 3600.0, 2),
            false_alarms: self.false_alarms,
            faulty_sessions: n,
            detected: detected as u64,
            detection_rate: share(detected, n),
            within_2s: within(2.0),
            within_5s: within(5.0),
            isolated_right: right as u64,
            isolation_rate: share(right, detected as u64),
            detected_and_right: share(right, n),
            delay_median_s: nearest_rank(&delays, 0.5).map(|s| rounded(s, 2)),
            delay_p90_s: nearest_rank(&delays, 0.9).map(|s| rounded(s, 2)),
            delay_from_onset_median_s: median(&from_onset).map(|s| rounded(s, 2)),
            no_chance: self.no_chance,
            by_kind,
            matrix: self.matrix,
        }
    }

    fn by_kind(&self) -> BTreeMap<String, KindScore> {
        let of_kind = |(kind, n): (&String, &u64)| {
            let found: Vec<&Detection> =
                self.detections.iter().filter(|d| d.kind == *kind).collect();
            let delays = sorted(found.iter().map(|d| d.delay_s));
            let figures = KindScore {
                n: *n,
                detected: found.len() as u64,
                right: found.iter().filter(|d| d.right).count() as u64,
                delay_median_s: median(&delays).map(|s| rounded(s, 2)),
            };
            (kind.clone(), figures)
        };
        self.kinds.iter().map(of_kind).collect()
    }
}

impl ScoreReport {
    /// Returns the scalar figures, with their names and units.
    pub(super) fn overall(&self) -> Vec<(&'static str, String)> {
        let share = |s: Option<f64>| s.map_or("-".to_owned(), |s| format!("{:.1} %", s * 100.0));
        let seconds = |s: Option<f64>| s.map_or("-".to_owned(), |s| format!("{s:.2} s"));
        vec![
            ("healthy time", format!("{:.2} h", self.healthy_hours)),
            ("false alarms", self.false_alarms.to_string()),
            ("faulty sessions", self.faulty_sessions.to_string()),
            ("detected", format!("{} = {}", self.detected, share(self.detection_rate))),
            ("within 2 s", share(self.within_2s)),
            ("within 5 s", share(self.within_5s)),
            (
                "right code of those",
                format!("{} = {}", self.isolated_right, share(self.isolation_rate)),
            ),
            ("detected and right", share(self.detected_and_right)),
            ("delay from first chance, median", seconds(self.delay_median_s)),
            ("delay from first chance, 90 %", seconds(self.delay_p90_s)),
            ("delay from onset, median", seconds(self.delay_from_onset_median_s)),
            ("no chance, left out", self.no_chance.to_string()),
        ]
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Rounds to the nearest decimal number with `digits` digits after the point.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$}").parse().unwrap_or(value)
}

/// Returns the quantile `p` by the nearest-rank method.
fn nearest_rank(sorted: &[f64], p: f64) -> Option<f64> {
    let rank = (p * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1).min(sorted.len()).checked_sub(1)?).copied()
}

/// Returns the median.
fn median(sorted: &[f64]) -> Option<f64> {
    let middle = sorted.len() / 2;
    match (sorted.len(), sorted.len() % 2) {
        (0, _) => None,
        (_, 1) => Some(sorted[middle]),
        _ => Some((sorted[middle - 1] + sorted[middle]) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn label(kind: Option<(&str, f64, Option<f64>)>) -> Label {
        let fault = kind.map(|(kind, onset_s, chance_s)| LabelledFault {
            kind: kind.to_owned(),
            axis: None,
            size: None,
            onset_s,
            end_s: None,
            chance_s,
        });
        Label {
            file: String::new(),
            rig: String::new(),
            motion: String::new(),
            seconds: 60.0,
            rows: 0,
            class: if kind.is_some() { "x_servo" } else { "healthy" }.to_owned(),
            also: vec!["sensor".to_owned()],
            fault,
        }
    }

    fn found(code: &str, t_s: f64) -> Option<FirstConfirmed> {
        Some(FirstConfirmed { code: code.to_owned(), kind: None, t_s })
    }

    /// Counted by hand: eight sessions, one of each outcome.
    #[test]
    fn validate_figures_against_a_hand_count() {
        let dead = |chance| label(Some(("dead", 20.0, chance)));
        let sessions = [
            (label(None), None),
            (label(None), found("sensor", 5.0)),
            (dead(Some(21.0)), found("x_servo", 20.5)), // before its chance: delay 0
            (dead(Some(21.0)), found("x_servo", 24.0)), // delay 3
            (dead(None), found("sensor", 30.0)),        // also right: delay 10 from onset
            (dead(Some(20.0)), found("y_servo", 26.0)), // wrong: delay 6
            (dead(Some(20.0)), found("x_servo", 19.0)), // early
            (dead(Some(20.0)), None),
            (dead(None), None), // no chance
        ];
        let figures = figures(sessions.iter().map(|(l, f)| (l, f.as_ref())));
        let expected = ScoreReport {
            healthy_hours: rounded(260.0 / 3600.0, 2),
            false_alarms: 2,
            faulty_sessions: 6,
            detected: 4,
            detection_rate: Some(0.6667),
            within_2s: Some(0.1667),
            within_5s: Some(0.3333),
            isolated_right: 3,
            isolation_rate: Some(0.75),
            detected_and_right: Some(0.5),
            delay_median_s: Some(3.0),
            delay_p90_s: Some(10.0),
            delay_from_onset_median_s: Some(5.0),
            no_chance: 1,
            by_kind: BTreeMap::from([(
                "dead".to_owned(),
                KindScore { n: 6, detected: 4, right: 3, delay_median_s: Some(4.5) },
            )]),
            matrix: BTreeMap::from(
                [
                    ("healthy -> none", 1),
                    ("healthy -> sensor", 1),
                    ("x_servo -> early", 1),
                    ("x_servo -> none", 1),
                    ("x_servo -> x_servo", 3),
                    ("x_servo -> y_servo", 1),
                ]
                .map(|(pair, n)| (pair.to_owned(), n)),
            ),
        };
        assert_eq!(figures, expected);
    }

    #[test]
    fn an_empty_corpus_has_no_rates() {
        let figures = figures(std::iter::empty());
        assert_eq!((figures.detection_rate, figures.delay_median_s), (None, None));
    }
}
