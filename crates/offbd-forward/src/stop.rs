//! When the agent is told to stop.

use tokio::sync::watch;

/// Whether the agent has been told to stop.
#[derive(Clone, Debug)]
pub(super) struct Stop {
    told: watch::Receiver<bool>,
}

impl Stop {
    /// Stops at SIGINT or SIGTERM, which do not end the process by themselves from now on.
    ///
    /// # Errors
    /// If the system does not let the process wait for signals.
    pub(super) fn at_signal() -> std::io::Result<Self> {
        let signal = signal()?;
        let (tell, told) = watch::channel(false);
        tokio::spawn(async move {
            signal.await;
            tell.send_replace(true);
        });
        Ok(Self { told })
    }

    pub(super) fn is_told(&self) -> bool {
        *self.told.borrow()
    }

    /// Waits until the agent is told to stop.
    pub(super) async fn told(&mut self) {
        if self.told.wait_for(|told| *told).await.is_err() {
            // Nothing can tell it any more.
            std::future::pending().await
        }
    }
}

#[cfg(unix)]
fn signal() -> std::io::Result<impl Future<Output = ()> + Send + 'static> {
    use tokio::signal::unix::{SignalKind, signal};
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

#[cfg(not(unix))]
fn signal() -> std::io::Result<impl Future<Output = ()> + Send + 'static> {
    Ok(async { drop(tokio::signal::ctrl_c().await) })
}
