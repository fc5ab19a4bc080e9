//! Number of threads.

use anyhow::Context;

/// Most threads: per core, and in any case. More take minutes to start and gain nothing.
const MAX_THREADS: (usize, usize) = (4, 64);

/// Sets the number of threads; `None` uses all cores.
pub(super) fn set_threads(threads: Option<u16>) -> anyhow::Result<()> {
    if let Some(threads) = threads {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let most = MAX_THREADS.1.max(MAX_THREADS.0 * cores);
        let threads = usize::from(threads);
        if threads > most {
            tracing::warn!("--threads {threads}: there are {cores} cores; {most} threads are used");
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.min(most));
        pool.build_global()
            .context("cannot start that many threads")?;
    }
    Ok(())
}
