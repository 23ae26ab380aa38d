//! Compares the verdict of an ended session with its recording, judged again.

use crate::{ServiceError, views};
use offbd_core::engine::{Input, Setup};
use offbd_store::SessionRow;
use offbd_wire::judging::Judging;
use offbd_wire::stored::StoredVerdict;

/// An ended session that is judged again.
pub(super) struct VerdictCheck {
    judging: Judging,
    /// The hash in the session's row, and that in its verdict.
    stored: [String; 2],
}

impl VerdictCheck {
    /// Returns `None` if `session` has no verdict, or one of another version or another kind
    /// of machine, which may rightly differ.
    pub(super) fn start(session: &SessionRow) -> Result<Option<Self>, ServiceError> {
        let (Some(verdict), Some(hash)) = (&session.verdict, &session.verdict_hash) else {
            return Ok(None);
        };
        let verdict: StoredVerdict = views::from_json(verdict)?;
        if !verdict.can_be_repeated() {
            return Ok(None);
        }
        let setup = Setup::new(views::rig(&session.setup)?, None)?;
        let judging = Judging::new(setup, views::memory(&session.baseline)?);
        Ok(Some(Self { judging, stored: [hash.clone(), verdict.summary.verdict_hash] }))
    }

    /// Takes the next input of the session.
    pub(super) fn take(&mut self, input: Input) {
        self.judging.input(input);
    }

    /// Ends the session. Returns whether its verdict is another one.
    pub(super) fn differs(mut self) -> bool {
        self.judging.input(Input::End);
        let found = self.judging.summary("", 0).verdict_hash;
        self.stored.iter().any(|stored| *stored != found)
    }
}
