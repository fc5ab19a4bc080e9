//! Number of threads.

use anyhow::Context;

/// Sets the number of threads; all cores without one.
pub(super) fn set_threads(threads: Option<u16>) -> anyhow::Result<()> {
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        pool.build_global()
            .context("cannot start that many threads")?;
    }
    Ok(())
}
