//! Processor that the program runs on.

use std::time::Duration;

/// The processor's name, where the system tells it, or else its kind.
pub(crate) fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == "model name").then(|| value.trim().to_owned())
    });
    name.filter(|name| !name.is_empty())
        .unwrap_or_else(|| format!("{} processor", std::env::consts::ARCH))
}

/// Cores that the program may use.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, Into::into)
}

/// How long the program's threads have waited for a core, all together; none where the system does not tell.
///
/// Threads that have ended no longer count.
pub(crate) fn waited_for_cores() -> Option<Duration> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?;
    let waited = |task: std::fs::DirEntry| {
        // Nanoseconds on a core, nanoseconds ready and waiting for one, turns.
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().nth(1)?.parse::<u64>().ok()
    };
    let all: Vec<u64> = tasks.flatten().filter_map(waited).collect();
    (!all.is_empty()).then(|| Duration::from_nanos(all.iter().sum()))
}
