//! Detects that a device without session names has restarted.

use super::recorded::RecordedSamples;
use super::session::OpenSession;
use offbd_core::engine::{Recognition, rejection};
use offbd_core::vocabulary::Sample;
use offbd_wire::table::starts_again;

/// How far the clock must go back for samples that are not recorded yet to show a restart,
/// s. Below it, they are late. Chosen.
const RESTART_S: f64 = 10.0;

/// Consecutive different samples that show another run of the device until it is certain:
/// one may have a wrong time.
pub(super) const CERTAIN_AFTER: u32 = 2;

/// Returns how many of the first `samples`, of which there is at least one, come before the clock or
/// the numbers of the batch start again. The others may be of another run, which shows only once
/// these are recorded.
pub(super) fn first_run(samples: &[(usize, Sample)]) -> usize {
    let Some(((_, first), rest)) = samples.split_first() else { return 0 };
    let (mut latest_s, mut last_seq) = (first.t_s, first.seq);
    let is_restart = |(_, sample): &(usize, Sample)| {
        let again = match (first.seq, last_seq, sample.seq) {
            (Some(first), Some(last), Some(seq)) => seq <= first && seq < last,
            _ => starts_again(first.t_s, latest_s, sample.t_s),
        };
        (latest_s, last_seq) = (latest_s.max(sample.t_s), last_seq.max(sample.seq));
        again
    };
    rest.iter().position(is_restart).map_or(samples.len(), |before| before + 1)
}

/// What one sample shows about a restart.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sign {
    /// It continues the session.
    Continues,
    /// It is recorded already: a retransmission, or a device that restarts with the
    /// values it had before.
    Repeats,
    /// It is not part of the session.
    StartsAnew,
}

impl OpenSession {
    /// Returns how many of the first `samples` belong to this session; the device has
    /// restarted before the others. A device has restarted if samples have the keys of
    /// recorded ones and other values, or if its clock goes back to times that are not a gap
    /// of the recording.
    pub(super) fn continued_by(
        &mut self,
        samples: &[(usize, Sample)],
        recorded: &RecordedSamples,
    ) -> usize {
        let mut latest_s = self.judging.counts().span_s.map_or(f64::NEG_INFINITY, |(_, last)| last);
        let mut start = None;
        for (i, (_, sample)) in samples.iter().enumerate() {
            if rejection(&self.judging.engine().setup().rig, sample).is_some() {
                // An invalid row shows nothing.
                continue;
            }
            match self.sign(sample, latest_s, recorded) {
                // What fills a hole between conflicts may be part of another run as well.
                Sign::Continues if start.is_some() && !self.is_beyond(sample, latest_s) => {}
                Sign::Continues => {
                    (start, self.n_restart_signs) = (None, 0);
                    latest_s = latest_s.max(sample.t_s);
                }
                Sign::Repeats => {
                    start.get_or_insert(i);
                }
                Sign::StartsAnew => {
                    let start = *start.get_or_insert(i);
                    // A retransmission of the same sample shows nothing new.
                    if self.last_restart_sign.replace(*sample) != Some(*sample) {
                        self.n_restart_signs += 1;
                    }
                    if self.n_restart_signs >= CERTAIN_AFTER {
                        return start;
                    }
                }
            }
        }
        samples.len()
    }

    fn sign(&self, sample: &Sample, latest_s: f64, recorded: &RecordedSamples) -> Sign {
        let engine = self.judging.engine();
        let is_far_behind = sample.t_s < latest_s - RESTART_S;
        match recorded.recognise(engine.recognise(sample), sample) {
            Recognition::Conflict => Sign::StartsAnew,
            // It was sent late, before the device can have restarted.
            Recognition::Same if engine.precedes(sample) => Sign::Continues,
            Recognition::Same => Sign::Repeats,
            Recognition::New if is_far_behind && !self.is_beyond(sample, latest_s) => {
                if engine.fits_gap(sample) { Sign::Continues } else { Sign::StartsAnew }
            }
            Recognition::New | Recognition::Taken | Recognition::Unknown => Sign::Continues,
        }
    }

    /// Whether a sample is after all those recorded: by its number, since the clock of a
    /// device that counts may have been set back, or else by its time.
    fn is_beyond(&self, sample: &Sample, latest_s: f64) -> bool {
        match sample.seq.and_then(|seq| i64::try_from(seq).ok()) {
            Some(seq) => self.progress.last_seq.is_none_or(|last| seq > last),
            None => sample.t_s > latest_s,
        }
    }
}
