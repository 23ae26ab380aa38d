//! Server-Sent Events: fault lines as the service publishes them.

use reqwest::Response;
use tokio::sync::mpsc;

use crate::wire::verdict::FaultView;

/// Fault lines that may wait for the demo to print them.
const MAX_WAITING: usize = 1024;

/// Reads fault lines from `answer` until it ends.
pub(super) fn listen(mut answer: Response) -> mpsc::Receiver<FaultView> {
    let (sender, receiver) = mpsc::channel(MAX_WAITING);
    tokio::spawn(async move {
        let mut lines = Lines::default();
        while let Ok(Some(bytes)) = answer.chunk().await {
            for fault in lines.faults(&bytes) {
                if sender.send(fault).await.is_err() {
                    return;
                }
            }
        }
    });
    receiver
}

/// Bytes that have come and are no whole line yet.
#[derive(Default)]
struct Lines {
    rest: Vec<u8>,
}

impl Lines {
    /// The fault lines that are complete with `bytes`. The service writes each
    /// in one `data:` line; everything else (ids, comments) is left out.
    fn faults(&mut self, bytes: &[u8]) -> Vec<FaultView> {
        self.rest.extend_from_slice(bytes);
        let Some(end) = self.rest.iter().rposition(|b| *b == b'\n') else { return Vec::new() };
        let whole: Vec<u8> = self.rest.drain(..=end).collect();
        let data = whole.split(|b| *b == b'\n').filter_map(|l| l.strip_prefix(b"data:"));
        data.filter_map(|json| serde_json::from_slice(json).ok()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::basis::Basis;
    use crate::wire::verdict::fault_view;
    use offbd_core::diagnosis::{Evidence, StatusByte, Suspicion, Transition};
    use offbd_core::vocabulary::{FaultCode, FaultStatus, SimTime};

    #[test]
    fn lines_cut_anywhere_are_put_together() {
        let transition = Transition {
            at: SimTime::new(1.5).unwrap(),
            code: FaultCode::XServo,
            status: FaultStatus::Pending,
            byte: StatusByte::default(),
            suspicion: Suspicion::default(),
            evidence: Evidence::default(),
        };
        let json = serde_json::to_string(&fault_view("a", &Basis::default(), &transition)).unwrap();
        let text = format!(": hello\n\nid: 7\nevent: fault\ndata: {json}\n\n:\n\n");
        for cut in 0..text.len() {
            let mut lines = Lines::default();
            let mut faults = lines.faults(&text.as_bytes()[..cut]);
            faults.extend(lines.faults(&text.as_bytes()[cut..]));
            assert_eq!(faults.len(), 1, "cut at {cut}");
            assert_eq!(faults[0].t_s, 1.5);
        }
    }
}
