//! Remarks on a moment or a stretch of a session.

use uuid::Uuid;

use crate::clock::rfc3339;
use crate::{Service, ServiceError};
use offbd_core::vocabulary::Invalid;
use offbd_store::{RemarkRow, RemarkWrite, Write};
use offbd_wire::remark::{NewRemarkView, RemarkView};

/// Longest text of a remark, bytes; a longer one is refused.
const MAX_REMARK: usize = 2000;

/// Limit of the remarks on a session; a further one is refused. Requests at the same time may
/// exceed it by a few.
const MAX_REMARKS: usize = 500;

impl Service {
    /// Returns the remarks on a session, in order of time.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`].
    pub async fn remarks(&self, session: &str) -> Result<Vec<RemarkView>, ServiceError> {
        self.session_asset(session).await?;
        let rows = self.inner.handles.store.remarks(session).await?;
        Ok(rows.into_iter().map(view).collect())
    }

    /// Adds a remark by `actor` to a session, which may be open.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::Invalid`] with the invalid element;
    /// [`ServiceError::TooManySettings`] if the session has too many.
    pub async fn add_remark(
        &self,
        session: &str,
        new: NewRemarkView,
        actor: String,
    ) -> Result<RemarkView, ServiceError> {
        let asset = self.session_asset(session).await?;
        let (text, to_s) = check(&new)?;
        if self.inner.handles.store.remarks(session).await?.len() >= MAX_REMARKS {
            let what = "remarks on a session";
            return Err(ServiceError::TooManySettings { what, limit: MAX_REMARKS });
        }
        let row = RemarkRow {
            id: Uuid::now_v7().to_string(),
            session: session.to_owned(),
            from_s: new.from_s,
            to_s,
            text,
            actor,
            at: self.inner.handles.clock.now(),
        };
        let write = Write::Remark(RemarkWrite::Add(row.clone()));
        self.inner.handles.write(&asset, vec![write]).await?;
        // The session may have been deleted meanwhile.
        self.session_asset(session).await?;
        Ok(view(row))
    }

    /// Removes a remark.
    ///
    /// # Errors
    /// [`ServiceError::UnknownSession`]; [`ServiceError::UnknownRemark`].
    pub async fn remove_remark(&self, session: &str, id: &str) -> Result<(), ServiceError> {
        let asset = self.session_asset(session).await?;
        let rows = self.inner.handles.store.remarks(session).await?;
        if !rows.iter().any(|row| row.id == id) {
            return Err(ServiceError::UnknownRemark { id: id.to_owned() });
        }
        let remove = RemarkWrite::Remove { session: session.to_owned(), id: id.to_owned() };
        self.inner.handles.write(&asset, vec![Write::Remark(remove)]).await
    }
}

/// Returns the text without surrounding blanks, and the end of the stretch.
fn check(new: &NewRemarkView) -> Result<(String, f64), Invalid> {
    let text = new.text.trim();
    let is_permitted = (1..=MAX_REMARK).contains(&text.len());
    if !is_permitted || text.chars().any(|c| c.is_control() && c != '\n') {
        let must = format!("must be 1 to {MAX_REMARK} bytes without control characters");
        return Err(Invalid::new("/text", must));
    }
    let to_s = new.to_s.unwrap_or(new.from_s);
    for (element, t_s) in [("/from_s", new.from_s), ("/to_s", to_s)] {
        if !t_s.is_finite() {
            return Err(Invalid::new(element, "must be a finite number of seconds"));
        }
    }
    if to_s < new.from_s {
        return Err(Invalid::new(
            "/to_s",
            format!("{to_s} s is before `from_s`, {} s", new.from_s),
        ));
    }
    Ok((text.to_owned(), to_s))
}

fn view(row: RemarkRow) -> RemarkView {
    let RemarkRow { id, session: _, from_s, to_s, text, actor, at } = row;
    RemarkView { id, text, by: actor, from_s, to_s, at: rfc3339(at) }
}
