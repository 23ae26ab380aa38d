//! Looks up samples that are older than those that the engine remembers.

use std::collections::BTreeMap;

use super::session::OpenSession;
use super::turn::Turn;
use crate::ServiceError;
use offbd_core::engine::Recognition;
use offbd_core::vocabulary::Sample;
use offbd_store::Write;
use offbd_wire::telemetry::{SampleKey, sample_key};

/// Limit of the chunks of a recording that are searched for the samples of one batch. Chosen:
/// a batch of a device spans few.
const MAX_CHUNKS_SEARCHED: u32 = 256;

/// The samples of a recording that have the times of a batch.
#[derive(Debug, Default)]
pub(super) struct RecordedSamples {
    by_key: BTreeMap<SampleKey, Sample>,
    /// Whether too many chunks would have had to be searched.
    is_partial: bool,
}

impl RecordedSamples {
    /// Looks up `samples` in the recording of `session`, also in what this turn adds to it.
    pub(super) fn find<'a>(
        session: &str,
        samples: impl IntoIterator<Item = &'a Sample>,
        turn: &Turn<'_>,
    ) -> Result<Self, ServiceError> {
        let mut times: Vec<f64> = samples.into_iter().map(|sample| sample.t_s).collect();
        if times.is_empty() {
            return Ok(Self::default());
        }
        times.sort_by(f64::total_cmp);
        let handles = &turn.env.handles;
        let found = handles.store.samples_at(session, &times, MAX_CHUNKS_SEARCHED);
        let found = handles.wait(found)?;
        let mut this = Self { by_key: BTreeMap::new(), is_partial: found.is_none() };
        this.add(&found.unwrap_or_default());
        for write in &turn.writes {
            if let Write::Append { session: id, samples, .. } = write
                && id == session
            {
                this.add(samples);
            }
        }
        Ok(this)
    }

    /// Looks up those of `samples` that the engine of `open` does not remember.
    pub(super) fn unremembered(
        open: &OpenSession,
        samples: &[(usize, Sample)],
        turn: &Turn<'_>,
    ) -> Result<Self, ServiceError> {
        let engine = open.judging.engine();
        let old: Vec<&Sample> = samples
            .iter()
            .map(|(_, sample)| sample)
            .filter(|sample| sample.t_s.is_finite())
            .filter(|sample| {
                matches!(engine.recognise(sample), Recognition::Taken | Recognition::Unknown)
            })
            .collect();
        if old.is_empty() {
            return Ok(Self::default());
        }
        turn.barrier()?;
        Self::find(&open.id, old, turn)
    }

    /// Adds what was found in another session.
    pub(super) fn merge(&mut self, other: Self) {
        self.by_key.extend(other.by_key);
        self.is_partial |= other.is_partial;
    }

    /// Adds samples that are recorded now.
    pub(super) fn add(&mut self, samples: &[Sample]) {
        self.by_key.extend(samples.iter().map(|sample| (sample_key(sample), *sample)));
    }

    /// Returns what is known of `sample`, given what the `engine` knows.
    pub(super) fn recognise(&self, engine: Recognition, sample: &Sample) -> Recognition {
        if !matches!(engine, Recognition::Taken | Recognition::Unknown) {
            return engine;
        }
        match self.by_key.get(&sample_key(sample)) {
            Some(recorded) if recorded == sample => Recognition::Same,
            Some(_) => Recognition::Conflict,
            None if self.is_partial => Recognition::Unknown,
            // Not at its time: so with another one.
            None if engine == Recognition::Taken => Recognition::Conflict,
            None => Recognition::New,
        }
    }
}
