//! Wakes the tasks of a node when another node has changed something.

use std::time::Duration;

use crate::writing::Handles;
use crate::{ServiceError, cluster::Cluster, writing::Events};
use offbd_store::Notification;

/// Pause before the next attempt to connect. Chosen; meanwhile both tasks look by themselves.
const RETRY_AFTER: Duration = Duration::from_secs(1);

/// Receives notifications until the service shuts down.
pub(super) async fn run(handles: Handles, cluster: Cluster, events: Events) {
    let closing = handles.closing.clone();
    let forever = async {
        loop {
            if let Err(error) = listen(&handles, &cluster, &events).await {
                tracing::debug!(%error, "no notifications of the database");
            }
            tokio::time::sleep(RETRY_AFTER).await;
        }
    };
    closing.run_until_cancelled(forever).await;
}

async fn listen(handles: &Handles, cluster: &Cluster, events: &Events) -> Result<(), ServiceError> {
    let Some(mut notifications) = handles.store.notifications().await? else { return Ok(()) };
    let mut notification = Notification::Unknown;
    loop {
        if notification != Notification::Event {
            cluster.poke.notify_one();
        }
        if notification != Notification::Transfer {
            events.wake();
        }
        // The server may have ended all connections of this process, that of the writer too.
        let lost = |_: &_| handles.ownership.note_disconnected();
        notification = notifications.next().await.inspect_err(lost)?;
    }
}
