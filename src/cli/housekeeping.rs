//! What a running service does by itself: erasures that were cut off, and the rules of retention.

use crate::storage::Store;
use crate::storage::audit::Actor;
use crate::storage::retention::{Retained, RetentionRules};
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// How often erasures that are not done are taken up.
const EVERY: Duration = Duration::from_secs(60);
/// Rounds from one look at the rules of retention to the next.
const ROUNDS: u32 = 60;

/// Goes on until `stop`. Failures are logged, and tried again in the next round.
pub(super) async fn run(store: Store, rules: RetentionRules, stop: CancellationToken) {
    let mut ticks = tokio::time::interval(EVERY);
    ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    for round in (0..ROUNDS).cycle() {
        if stop.run_until_cancelled(ticks.tick()).await.is_none() {
            return;
        }
        match store.resume_erasures().await {
            Ok(0) => {}
            Ok(n) => tracing::info!(n, "went on with erasures that were not done"),
            Err(error) => tracing::error!(%error, "an erasure could not be completed"),
        }
        if round > 0 {
            continue;
        }
        match store.apply_retention(&rules, Actor::service).await {
            Ok(done) if done == Retained::default() => {}
            Ok(done) => tracing::info!(?done, "removed what the rules of retention say"),
            Err(error) => tracing::error!(%error, "the rules of retention could not be applied"),
        }
    }
}
