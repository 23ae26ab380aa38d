//! Whether another asset may be registered, without counting all of them each time.

use std::sync::{Mutex, PoisonError};

/// Registrations after which the assets are counted again, because other nodes of a cluster
/// register some as well: together they may exceed the limit by as many each. Chosen: PostgreSQL
/// takes about 10 ms to count 100 000.
const COUNT_EVERY: usize = 64;

/// The number of assets as last counted, with those registered since.
#[derive(Debug)]
pub(super) struct AssetQuota {
    limit: usize,
    estimate: Mutex<Estimate>,
}

#[derive(Debug, Default)]
struct Estimate {
    /// At least as many as there are, except for those of other nodes.
    n: usize,
    /// Registrations until the next count.
    n_left: usize,
}

impl AssetQuota {
    pub(super) fn new(limit: usize) -> Self {
        Self { limit, estimate: Mutex::default() }
    }

    pub(super) const fn limit(&self) -> usize {
        self.limit
    }

    /// Takes the place of one more asset. Returns false if the assets are to be counted first.
    pub(super) fn take(&self) -> bool {
        let mut estimate = self.estimate.lock().unwrap_or_else(PoisonError::into_inner);
        let is_free = estimate.n_left > 0 && estimate.n < self.limit;
        if is_free {
            estimate.n += 1;
            estimate.n_left -= 1;
        }
        is_free
    }

    /// Takes the place of one more asset, now that there are `n`. Returns false if there is none.
    pub(super) fn take_of(&self, n: usize) -> bool {
        let mut estimate = self.estimate.lock().unwrap_or_else(PoisonError::into_inner);
        *estimate = Estimate { n, n_left: COUNT_EVERY };
        drop(estimate);
        self.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Registers assets; returns how many were accepted, and how often they were counted.
    fn register(quota: &AssetQuota, n_assets: &mut usize, n: usize) -> (usize, usize) {
        let (mut n_accepted, mut n_counts) = (0, 0);
        for _ in 0..n {
            let is_accepted = quota.take() || {
                n_counts += 1;
                quota.take_of(*n_assets)
            };
            n_accepted += usize::from(is_accepted);
            *n_assets += usize::from(is_accepted);
        }
        (n_accepted, n_counts)
    }

    #[test]
    fn the_limit_is_exact_and_few_registrations_count() {
        let (quota, mut n_assets) = (AssetQuota::new(1000), 0);
        assert_eq!(register(&quota, &mut n_assets, 990), (990, 990_usize.div_ceil(COUNT_EVERY)));
        assert_eq!(register(&quota, &mut n_assets, 20).0, 10);
        // A deletion makes room at once.
        n_assets -= 1;
        assert_eq!(register(&quota, &mut n_assets, 2).0, 1);
    }

    #[test]
    fn what_other_nodes_register_is_noticed() {
        let (quota, mut n_assets) = (AssetQuota::new(1000), 0);
        register(&quota, &mut n_assets, 1);
        n_assets = 1000;
        assert!(register(&quota, &mut n_assets, 1000).0 < COUNT_EVERY);
    }
}
