//! The size of the residual of a session: how far its accelerations are from the twin's.

use offbd_core::diagnosis::Evidence;
use offbd_core::vocabulary::{Axis, PerAxis, SimTime};
use serde::{Deserialize, Serialize};

/// Sums the squares of the residual over the moments at which it may be judged.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct ResidualSize {
    /// The moment that was taken last, so that one that is still the newest counts once.
    at: Option<SimTime>,
    axes: PerAxis<SquareSum>,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct SquareSum {
    n: u64,
    sum: f64,
}

impl ResidualSize {
    /// Takes the evidence of the last judged sample.
    pub(super) fn take(&mut self, evidence: &Evidence) {
        if evidence.at == self.at {
            return;
        }
        self.at = evidence.at;
        for axis in Axis::ALL {
            let of_axis = &evidence.axes[axis];
            if let Some(residual) = of_axis.residual_m_s2().filter(|_| of_axis.enabled) {
                self.axes[axis].n += 1;
                self.axes[axis].sum += residual * residual;
            }
        }
    }

    /// Returns the root mean square along each axis, m/s²; `None` if there was no such moment.
    pub(super) fn rms_m_s2(&self) -> PerAxis<Option<f64>> {
        self.axes.map(|of| (of.n > 0).then(|| (of.sum / of.n as f64).sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::AxisEvidence;

    fn evidence(t_s: f64, residual_m_s2: f64, enabled: bool) -> Evidence {
        let (measured_m_s2, twin_m_s2) = (Some(1.0 + residual_m_s2), Some(1.0));
        let x = AxisEvidence { measured_m_s2, twin_m_s2, enabled, ..AxisEvidence::default() };
        let axes = PerAxis { x, y: AxisEvidence::default() };
        Evidence { at: SimTime::new(t_s), axes, ..Evidence::default() }
    }

    #[test]
    fn only_judged_moments_count_and_each_once() {
        let mut size = ResidualSize::default();
        for (t_s, residual, enabled) in
            [(0.0, 3.0, true), (0.0, 3.0, true), (0.05, 100.0, false), (0.1, -4.0, true)]
        {
            size.take(&evidence(t_s, residual, enabled));
        }
        let rms = size.rms_m_s2();
        assert!((rms.x.unwrap() - 12.5_f64.sqrt()).abs() < 1e-12, "{rms:?}");
        assert_eq!(rms.y, None);
    }
}
