//! How much memory there is.

use anyhow::{Result, bail};

/// Where the system does not say, a case beyond this is refused.
const UNKNOWN: f64 = 16.0 * GIB;
const GIB: f64 = 1024.0 * 1024.0 * 1024.0;

/// Refuses what cannot fit, before it is tried.
pub(crate) fn require(bytes: f64, cells: usize) -> Result<()> {
    let available = available();
    if bytes > available {
        bail!(
            "--cells {cells}: this needs about {:.3e} GiB of memory, and {:.1} GiB are available; \
             use fewer cells or particles",
            bytes / GIB,
            available / GIB
        );
    }
    Ok(())
}

/// Bytes that can be had without swapping; where the system does not tell, what is believed.
pub(crate) fn available() -> f64 {
    told().unwrap_or(UNKNOWN)
}

/// Bytes that can be had without swapping, where the system tells.
pub(crate) fn told() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kibibytes)
}
