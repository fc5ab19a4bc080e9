//! Memory: how much is available, and errors for work that needs more.
//!
//! A failed allocation ends the program at once. On most systems an allocation larger than the free memory succeeds,
//! and the system kills the program when it writes. Memory that grows with the input is therefore estimated before it
//! is allocated, from measured bytes per triangle, pixel or path. Other memory is small in comparison.
//!
//! The crate `sysinfo` reads free memory and the limit of one control group, but neither the address space limit nor
//! enclosing groups, and counts cached pages as used. It would cause false refusals and killed renders.

use std::fmt::{Display, Formatter, Result as Written};
use std::path::Path;

/// Something that needs more memory than there is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shortage {
    /// Work or data that needs the memory, in the plural.
    pub what: String,
    /// Bytes needed.
    pub needed: u64,
    /// Bytes available.
    pub available: u64,
}

impl Display for Shortage {
    fn fmt(&self, out: &mut Formatter<'_>) -> Written {
        let gb = |bytes: u64| bytes as f64 / 1e9;
        let (needed, available) = (gb(self.needed), gb(self.available));
        let what = &self.what;
        write!(
            out,
            "not enough memory: {what} need about {needed:.2} GB, and {available:.2} GB are free"
        )
    }
}

impl std::error::Error for Shortage {}

/// Returns an error if `needed` bytes exceed the available memory. Succeeds where that is unknown.
pub fn check(what: impl Into<String>, needed: u64) -> Result<(), Shortage> {
    match available() {
        Some(available) if needed > available => Err(Shortage {
            what: what.into(),
            needed,
            available,
        }),
        _ => Ok(()),
    }
}

/// Bytes that this process can still take: the least of the machine's free memory and swap, the limit on its address
/// space (`ulimit -v`), and the limits of its control groups. `None` on systems other than Linux.
pub(crate) fn available() -> Option<u64> {
    let text = |path: &str| std::fs::read_to_string(path).ok();
    let machine = text("/proc/meminfo").and_then(|t| free(&t));
    let limits = text("/proc/self/limits").and_then(|t| address_space(&t));
    let used = text("/proc/self/status").and_then(|t| kilobytes(&t, "VmSize:"));
    let limit = limits.map(|limit| limit.saturating_sub(used.unwrap_or(0)));
    let group = text("/proc/self/cgroup").and_then(|t| group(&t));
    [machine, limit, group].into_iter().flatten().min()
}

/// The value of a line such as `VmSize:   12 kB` in bytes.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let number: u64 = line.split_whitespace().next()?.parse().ok()?;
    number.checked_mul(1024)
}

/// Free bytes of `/proc/meminfo`.
fn free(meminfo: &str) -> Option<u64> {
    let swap = kilobytes(meminfo, "SwapFree:").unwrap_or(0);
    Some(kilobytes(meminfo, "MemAvailable:")?.saturating_add(swap))
}

/// Soft limit of the address space in `/proc/self/limits`; `None` for none.
fn address_space(limits: &str) -> Option<u64> {
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Free bytes of the control group (version 2) in `/proc/self/cgroup`: the least of it and the groups around it.
fn group(cgroup: &str) -> Option<u64> {
    let own = cgroup.lines().find_map(|line| line.strip_prefix("0::/"))?;
    let root = Path::new("/sys/fs/cgroup");
    let own = root.join(own);
    let groups = own.ancestors().take_while(|path| path.starts_with(root));
    let free = |group: &Path| -> Option<u64> {
        let text = |name: &str| std::fs::read_to_string(group.join(name)).ok();
        let most: u64 = text("memory.max")?.trim().parse().ok()?;
        let current: u64 = text("memory.current")?.trim().parse().ok()?;
        // The system reclaims pages of files on demand, so they count as free.
        let stat = text("memory.stat").unwrap_or_default();
        let of = |name: &str| {
            stat.lines()
                .find_map(|l| l.strip_prefix(name)?.parse().ok())
        };
        let files = of("inactive_file ").unwrap_or(0) + of("active_file ").unwrap_or(0);
        Some(most.saturating_sub(current.saturating_sub(files)))
    };
    groups.filter_map(free).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_of_system_files_is_read() {
        let meminfo = "MemTotal: 100 kB\nMemAvailable:    50 kB\nSwapFree:  3 kB\n";
        assert_eq!(free(meminfo), Some(53 * 1024));
        assert_eq!(free("MemTotal: 100 kB\n"), None);
        let limits = "Limit  Soft Limit  Hard Limit Units\nMax stack size 8388608 unlimited bytes\n\
                      Max address space         2048000000           unlimited            bytes\n";
        assert_eq!(address_space(limits), Some(2_048_000_000));
        let none = limits.replace("2048000000", "unlimited");
        assert_eq!(address_space(&none), None);
        assert_eq!(group("12:cpu:/a\n"), None);
    }

    #[test]
    fn memory_shortage_says_what_and_how_much() {
        assert_eq!(check("a few bytes", 0), Ok(()));
        if available().is_some() {
            let shortage = check("all pixels", u64::MAX).unwrap_err();
            let words = shortage.to_string();
            let start = "not enough memory: all pixels need about 18446744073.71 GB, and ";
            assert!(words.starts_with(start), "{words}");
        }
    }
}
