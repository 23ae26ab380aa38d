//! Limits on the number of open connections, and a connection that counts against them
//! until it is closed, also after an upgrade to a WebSocket.

use std::collections::HashMap;
use std::io::{self, IoSlice};
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use offbd_http::subscriber;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Sleep, sleep};

/// Limits on open connections. Clones share the counts.
#[derive(Clone)]
pub(super) struct ConnectionLimits {
    max: usize,
    max_per_address: usize,
    open: Arc<Mutex<OpenConnections>>,
}

/// Numbers of open connections.
#[derive(Default)]
struct OpenConnections {
    total: usize,
    by_address: HashMap<IpAddr, usize>,
}

/// Permission for one connection; dropping it releases it.
pub(super) struct ConnectionPermit {
    address: IpAddr,
    open: Arc<Mutex<OpenConnections>>,
}

impl ConnectionLimits {
    /// Allows `max` connections in total, and `max_per_address` of one IPv4 address or
    /// one IPv6 network of 64 bits.
    pub(super) fn new(max: usize, max_per_address: usize) -> Self {
        Self { max, max_per_address, open: Arc::default() }
    }

    /// Returns a permit for a connection of `address`; `None` if a limit is reached.
    pub(super) fn take(&self, address: IpAddr) -> Option<ConnectionPermit> {
        let address = subscriber(address);
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        let of_address = open.by_address.get(&address).copied().unwrap_or_default();
        if open.total >= self.max || of_address >= self.max_per_address {
            return None;
        }
        open.total += 1;
        open.by_address.insert(address, of_address + 1);
        metrics::gauge!("offbd_connections").set(open.total as f64);
        Some(ConnectionPermit { address, open: self.open.clone() })
    }
}

impl Drop for ConnectionPermit {
    fn drop(&mut self) {
        let mut open = self.open.lock().unwrap_or_else(PoisonError::into_inner);
        open.total -= 1;
        if let Some(of_address) = open.by_address.get_mut(&self.address) {
            *of_address -= 1;
            if *of_address == 0 {
                open.by_address.remove(&self.address);
            }
        }
        metrics::gauge!("offbd_connections").set(open.total as f64);
    }
}

/// A connection with its permit. It fails if the peer does not read for too long.
pub(super) struct LimitedConnection {
    socket: TcpStream,
    write_timeout: Duration,
    /// Ends when a write has waited for `write_timeout`; `None` while no write waits.
    write_deadline: Option<Pin<Box<Sleep>>>,
    _permit: ConnectionPermit,
}

impl LimitedConnection {
    pub(super) fn new(
        socket: TcpStream,
        permit: ConnectionPermit,
        write_timeout: Duration,
    ) -> Self {
        Self { socket, write_timeout, write_deadline: None, _permit: permit }
    }

    /// Returns the result of a write, or an error if it has waited for too long.
    fn with_timeout<T>(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if written.is_ready() {
            self.write_deadline = None;
            return written;
        }
        let timeout = self.write_timeout;
        let deadline = self.write_deadline.get_or_insert_with(|| Box::pin(sleep(timeout)));
        deadline.as_mut().poll(context).map(|()| Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for LimitedConnection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_read(context, buffer)
    }
}

impl AsyncWrite for LimitedConnection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.socket).poll_write(context, bytes);
        self.with_timeout(context, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.socket).poll_write_vectored(context, slices);
        self.with_timeout(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.socket.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permits_are_limited_and_released_when_dropped() {
        let limits = ConnectionLimits::new(3, 2);
        let [a, b]: [IpAddr; 2] = ["192.0.2.1", "192.0.2.2"].map(|a| a.parse().unwrap());
        let first = limits.take(a).unwrap();
        let _second = limits.take(a).unwrap();
        assert!(limits.take(a).is_none(), "two of one address");
        let third = limits.take(b).unwrap();
        assert!(limits.take(b).is_none(), "three in all");
        drop(first);
        drop(third);
        assert!(limits.take(a).is_some());
        assert_eq!(limits.open.lock().unwrap().by_address.len(), 1, "released entries are removed");
    }

    #[test]
    fn ipv6_addresses_of_one_network_count_together() {
        let limits = ConnectionLimits::new(3, 1);
        let [a, b, c]: [IpAddr; 3] =
            ["2001:db8::1", "2001:db8::2", "2001:db8:0:1::1"].map(|a| a.parse().unwrap());
        let _first = limits.take(a).unwrap();
        assert!(limits.take(b).is_none(), "the same first 64 bits");
        assert!(limits.take(c).is_some());
    }
}
