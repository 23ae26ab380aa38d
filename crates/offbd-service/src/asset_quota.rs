//! Whether another asset may be registered, without counting all of them each time.

use std::sync::{Mutex, PoisonError};

use super::ServiceError;
use offbd_store::StoreError;

/// Registrations after which the assets are counted again, because other nodes of a cluster
/// register some as well: together they may exceed the limit by as many each. Chosen: a count
/// reads an entry of each asset.
const COUNT_EVERY: usize = 64;

/// The number of assets as last counted, with those registered since.
#[derive(Debug)]
pub(super) struct AssetQuota {
    limit: usize,
    estimate: Mutex<Estimate>,
    /// Held by the one registration that counts.
    counting: tokio::sync::Mutex<()>,
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
        Self { limit, estimate: Mutex::default(), counting: tokio::sync::Mutex::default() }
    }

    /// Takes the place of one more asset, after counting them by `count` if need be.
    ///
    /// # Errors
    /// [`ServiceError::RegistryFull`]; those of `count`.
    pub(super) async fn claim<F>(&self, count: impl FnOnce() -> F) -> Result<(), ServiceError>
    where
        F: Future<Output = Result<i64, StoreError>>,
    {
        if self.take() {
            return Ok(());
        }
        // Those that wait here find a fresh count.
        let _counting = self.counting.lock().await;
        if self.take() || self.take_of(usize::try_from(count().await?).unwrap_or(usize::MAX)) {
            return Ok(());
        }
        Err(ServiceError::RegistryFull { limit: self.limit })
    }

    /// Takes the place of one more asset. Returns false if the assets are to be counted first.
    fn take(&self) -> bool {
        let mut estimate = self.estimate.lock().unwrap_or_else(PoisonError::into_inner);
        let is_free = estimate.n_left > 0 && estimate.n < self.limit;
        if is_free {
            estimate.n += 1;
            estimate.n_left -= 1;
        }
        is_free
    }

    /// Takes the place of one more asset, now that there are `n`. Returns false if there is none.
    fn take_of(&self, n: usize) -> bool {
        let mut estimate = self.estimate.lock().unwrap_or_else(PoisonError::into_inner);
        *estimate = Estimate { n, n_left: COUNT_EVERY };
        drop(estimate);
        self.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::future::join_all;
    use std::sync::atomic::{AtomicI64, AtomicUsize, Ordering::SeqCst};

    /// Registers assets at the same time; returns how many were accepted, and how often they
    /// were counted.
    async fn register(quota: &AssetQuota, n_assets: &AtomicI64, n: usize) -> (usize, usize) {
        let n_counts = AtomicUsize::new(0);
        let count = || async {
            n_counts.fetch_add(1, SeqCst);
            let n = n_assets.load(SeqCst);
            // Others come while it is counted.
            tokio::task::yield_now().await;
            Ok(n)
        };
        let registered = (0..n).map(async |_| {
            let is_accepted = quota.claim(count).await.is_ok();
            n_assets.fetch_add(i64::from(is_accepted), SeqCst);
            usize::from(is_accepted)
        });
        let n_accepted = join_all(registered).await.into_iter().sum();
        (n_accepted, n_counts.load(SeqCst))
    }

    #[tokio::test]
    async fn the_limit_is_exact_and_few_registrations_count() {
        let (quota, n_assets) = (AssetQuota::new(1000), AtomicI64::new(0));
        let n_counts = 990_usize.div_ceil(COUNT_EVERY);
        assert_eq!(register(&quota, &n_assets, 990).await, (990, n_counts));
        assert_eq!(register(&quota, &n_assets, 20).await.0, 10);
        // A deletion makes room at once.
        n_assets.fetch_sub(1, SeqCst);
        assert_eq!(register(&quota, &n_assets, 2).await.0, 1);
    }

    #[tokio::test]
    async fn what_other_nodes_register_is_noticed() {
        let (quota, n_assets) = (AssetQuota::new(1000), AtomicI64::new(0));
        register(&quota, &n_assets, 1).await;
        n_assets.store(1000, SeqCst);
        assert!(register(&quota, &n_assets, 1000).await.0 < COUNT_EVERY);
    }
}
