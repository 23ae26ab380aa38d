//! Samples that a device sends again for a session that it names and that has ended.

use super::recorded::RecordedSamples;
use super::turn::Turn;
use crate::{ServiceError, views};
use offbd_core::engine::{Recognition, Rejection, rejection};
use offbd_core::vocabulary::Sample;
use offbd_store::{MAX_ENDED_SESSIONS, SessionRow};
use offbd_wire::telemetry::{AckView, RowView};
use offbd_wire::words::UnjudgedWord;

/// Answers for samples of a session that has ended: those that are recorded are duplicates.
/// Returns why rows are rejected.
/// Rows that the session rejected are rejected again, and so are others that are not later
/// than what it has, so that a device that resends until it gets 200 gets there.
///
/// # Errors
/// [`ServiceError::SessionEnded`] if a sample is later than all of the session.
pub(super) fn retransmitted(
    row: &SessionRow,
    samples: &[(usize, Sample)],
    turn: &Turn<'_>,
    ack: &mut AckView,
) -> Result<Vec<UnjudgedWord>, ServiceError> {
    let rig = views::rig(&row.setup)?;
    let valid = samples.iter().map(|(_, sample)| sample);
    let valid = valid.filter(|sample| rejection(&rig, sample).is_none());
    let recording = EndedRecording::search(row, valid.collect(), turn)?;
    let mut rejected = Vec::new();
    for (index, sample) in samples {
        let known = match rejection(&rig, sample) {
            Some(why) => Known::Refused(Refusal::Rejected(why)),
            None => recording.recognise(sample),
        };
        match known {
            Known::Recorded => {}
            Known::Refused(why) => rejected.push((*index, why)),
            Known::Later => {
                let (asset, name) = (row.asset.clone(), row.name.clone());
                return Err(ServiceError::SessionEnded { asset, name });
            }
        }
    }
    ack.duplicate += samples.len() - rejected.len();
    let mut reasons = Vec::with_capacity(rejected.len());
    for (index, why) in rejected {
        reasons.push(why.word());
        ack.rejected.push(RowView { index, reason: why.to_string() });
    }
    ack.session = Some(row.name.clone());
    ack.session_id = Some(row.id.clone());
    ack.last_seq = row.progress.last_seq.and_then(|seq| u64::try_from(seq).ok());
    Ok(reasons)
}

/// What a session that has ended knows of samples.
struct EndedRecording {
    samples: RecordedSamples,
    /// Whether all parts of the session were searched.
    is_whole: bool,
    last_seq: Option<i64>,
    newest_t_s: Option<f64>,
}

/// What is known of a valid sample.
enum Known {
    Recorded,
    /// It is later than all of the session.
    Later,
    Refused(Refusal),
}

impl EndedRecording {
    /// Looks up `samples` in the last parts of the session `row`. Blocks on the store.
    fn search(
        row: &SessionRow,
        samples: Vec<&Sample>,
        turn: &Turn<'_>,
    ) -> Result<Self, ServiceError> {
        let handles = &turn.env.handles;
        let parts = handles.wait(handles.store.parts(row.first_part(), MAX_ENDED_SESSIONS))?;
        let mut found = RecordedSamples::default();
        for part in &parts {
            found.merge(RecordedSamples::find(&part.id, samples.iter().copied(), turn)?);
        }
        let last = parts.first().unwrap_or(row);
        let is_first = parts.last().is_some_and(|oldest| oldest.part == 1);
        Ok(Self {
            samples: found,
            // A deleted part leaves none out.
            is_whole: parts.len() < MAX_ENDED_SESSIONS as usize || is_first,
            last_seq: last.progress.last_seq,
            newest_t_s: handles.wait(handles.store.newest_t_s(&last.id))?,
        })
    }

    fn recognise(&self, sample: &Sample) -> Known {
        Known::Refused(match self.samples.recognise(Recognition::Unknown, sample) {
            Recognition::Same => return Known::Recorded,
            Recognition::New if self.is_later(sample) => return Known::Later,
            Recognition::Conflict => Refusal::Rejected(Rejection::conflict(sample)),
            Recognition::New if self.is_whole => Refusal::SessionEnded,
            Recognition::New | Recognition::Taken | Recognition::Unknown => {
                Refusal::Rejected(Rejection::TooOld)
            }
        })
    }

    fn is_later(&self, sample: &Sample) -> bool {
        let Some(seq) = sample.seq else {
            return self.newest_t_s.is_none_or(|newest_s| sample.t_s > newest_s);
        };
        self.last_seq.is_none_or(|last| i64::try_from(seq).map_or(true, |seq| seq > last))
    }
}

/// Why a row of a session that has ended is rejected.
#[derive(Clone, Copy, Debug, thiserror::Error)]
enum Refusal {
    #[error(transparent)]
    Rejected(Rejection),
    #[error("not recorded: the session has ended")]
    SessionEnded,
}

impl Refusal {
    fn word(self) -> UnjudgedWord {
        match self {
            Self::Rejected(why) => why.into(),
            Self::SessionEnded => UnjudgedWord::SessionEnded,
        }
    }
}
