//! Measures CPU time, of the calling thread alone: other processes on the machine
//! disturb it little.

/// Minimum CPU time of one measurement, s: shorter runs are repeated until they
/// fill it. Chosen so that the clock's resolution (tens of ns to 1 µs) is
/// negligible.
const LEAST_S: f64 = 5e-3;

/// Maximum number of runs in one measurement. Chosen so that a run that does not
/// fill 5 ms takes under 20 ps: the compiler has optimised it away.
const MOST_RUNS: u32 = 1 << 28;

/// CPU time of one run, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CpuTime {
    /// The minimum of the repeated measurements: the least disturbed one.
    pub minimum_s: f64,
    /// The median of the repeated measurements.
    pub median_s: f64,
}

impl CpuTime {
    /// Returns the median over the minimum: 1 on an idle machine.
    #[must_use]
    pub fn spread(&self) -> f64 {
        self.median_s / self.minimum_s
    }

    /// Returns the CPU time per simulated second, µs/s, of a run that simulates
    /// `simulated_s` seconds.
    #[must_use]
    pub fn us_per_s(&self, simulated_s: f64) -> f64 {
        self.minimum_s * 1e6 / simulated_s
    }
}

/// Measures `run` `repeats` times (at least once), each time over as many runs as
/// fill 5 ms. Pass what `run` computes to [`std::hint::black_box`].
pub fn cpu_time(repeats: usize, run: impl FnMut()) -> CpuTime {
    time_by(now_s, repeats, run)
}

/// As [`cpu_time`], by a clock that returns s.
fn time_by(clock: impl Fn() -> f64, repeats: usize, mut run: impl FnMut()) -> CpuTime {
    let mut batch = |n| {
        let start_s = clock();
        for _ in 0..n {
            run();
        }
        clock() - start_s
    };
    let mut n = 1;
    let mut first_s = batch(n);
    while first_s < LEAST_S && n < MOST_RUNS {
        n = grown(n, first_s);
        first_s = batch(n);
    }
    let mut each_s = vec![first_s];
    each_s.extend((1..repeats).map(|_| batch(n)));
    for s in &mut each_s {
        *s /= f64::from(n);
    }
    let median_s = offbd_core::maths::median(&mut each_s).unwrap_or(f64::NAN);
    CpuTime { minimum_s: each_s.into_iter().fold(f64::INFINITY, f64::min), median_s }
}

/// Returns a number of runs expected to take 1.3 times the minimum, given that `n`
/// runs took `took_s`; at least twice `n`.
fn grown(n: u32, took_s: f64) -> u32 {
    let wanted = f64::from(n) * 1.3 * LEAST_S / took_s.max(1e-9);
    (wanted.ceil() as u32).clamp(n.saturating_mul(2), MOST_RUNS)
}

/// Calls `run` once; returns its result and its CPU time, s.
pub fn cpu_once<T>(run: impl FnOnce() -> T) -> (T, f64) {
    let start_s = now_s();
    let done = run();
    (done, now_s() - start_s)
}

/// Returns the CPU time of this thread so far, s.
#[cfg(unix)]
#[expect(clippy::disallowed_methods, reason = "charts measure cost; no verdict sees it")]
fn now_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Returns the wall-clock time, s, as a substitute on other platforms.
#[cfg(not(unix))]
#[expect(clippy::disallowed_methods, reason = "charts measure cost; no verdict sees it")]
fn now_s() -> f64 {
    use std::{sync::OnceLock, time::Instant};
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// A run takes 3 µs on this clock, and each tenth batch is disturbed for 10 ms.
    #[test]
    fn the_minimum_and_the_median_are_of_one_run() {
        let (at_s, n_read) = (Cell::new(0.0), Cell::new(0));
        let clock = || {
            n_read.set(n_read.get() + 1);
            if n_read.get() % 20 == 0 {
                at_s.set(at_s.get() + 1e-2);
            }
            at_s.get()
        };
        let mut n_runs = 0;
        let time = time_by(clock, 20, || {
            n_runs += 1;
            at_s.set(at_s.get() + 3e-6);
        });
        assert!((time.minimum_s / 3e-6 - 1.0).abs() < 1e-6, "{time:?}");
        assert!(
            (time.spread() - 1.0).abs() < 1e-6 && (time.us_per_s(1e-3) / 3e3 - 1.0).abs() < 1e-6
        );
        // The second batch takes 1.3 times the 5 ms that a measurement fills.
        assert_eq!(n_runs, 1 + 20 * 2167);
    }
}
