//! Cores that the system allows, and shares of them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::machine;

/// Cores of the machine, whether or not this process may use them; none where the system does not tell.
pub(super) fn cores_present() -> Option<usize> {
    cores_in(&fs::read_to_string("/sys/devices/system/cpu/online").ok()?)
}

/// The number of cores in a list such as `0-3,6`.
fn cores_in(list: &str) -> Option<usize> {
    list.trim().split(',').try_fold(0, |count, part| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last): (usize, usize) = (first.parse().ok()?, last.parse().ok()?);
        Some(count + last.checked_sub(first)? + 1)
    })
}

/// Causes that keep runs from cores, a line each.
pub(super) fn of_cores() -> Vec<String> {
    let mut all = Vec::new();
    let cores = machine::cores();
    if let Some(present) = cores_present().filter(|present| cores < *present) {
        all.push(format!(
            "{cores} of {present} cores may be used; taskset, a container or a batch system leaves out the others"
        ));
    }
    let group = Group::here();
    if let Some(share) = group.as_ref().and_then(Group::cores).filter(|share| *share < cores as f64)
    {
        all.push(format!(
            "a control group allows the time of {share} cores to {cores}; --threads {} keeps to it",
            share.floor().max(1.0)
        ));
    }
    if group.is_some_and(|group| group.is_throttled()) {
        all.push("a control group has held this process back: it used up its time".into());
    }
    if let Some(asked) = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.parse().ok())
        && (1..cores).contains(&asked)
    {
        all.push(format!("RAYON_NUM_THREADS={asked} leaves {} cores without work", cores - asked));
    }
    let load = fs::read_to_string("/proc/loadavg").ok();
    let load = load.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    // This process has been at work for seconds, which is little of the last minute.
    if let Some(load) = load.filter(|load| *load > 0.75 * cores as f64 + 1.0) {
        all.push(format!("other programs are at work: {load} wait for {cores} cores on average"));
    }
    all
}

/// A control group of Linux, with the groups around it.
struct Group {
    /// From the innermost one out.
    folders: Vec<PathBuf>,
}

impl Group {
    /// The group of this process; none where the system has none of the second kind.
    fn here() -> Option<Self> {
        let text = fs::read_to_string("/proc/self/cgroup").ok()?;
        Some(Self::below(Path::new("/sys/fs/cgroup"), &text))
    }

    /// The group that a list names, in the folder of all groups.
    fn below(root: &Path, list: &str) -> Self {
        let path = list.lines().find_map(|line| line.strip_prefix("0::")).unwrap_or("/");
        let own = root.join(path.trim_start_matches('/'));
        let folders = own.ancestors().take_while(|folder| folder.starts_with(root));
        Self { folders: folders.map(Path::to_owned).collect() }
    }

    /// The cores whose time the tightest of the groups allows; none where none is limited.
    fn cores(&self) -> Option<f64> {
        let quota = |folder: &PathBuf| {
            let text = fs::read_to_string(folder.join("cpu.max")).ok()?;
            let (quota, period) = text.trim().split_once(' ')?;
            Some(quota.parse::<f64>().ok()? / period.parse::<f64>().ok()?)
        };
        self.folders.iter().filter_map(quota).min_by(f64::total_cmp)
    }

    /// Whether one of the groups was held back.
    fn is_throttled(&self) -> bool {
        let times = |folder: &PathBuf| {
            let text = fs::read_to_string(folder.join("cpu.stat")).ok()?;
            let line = text.lines().find_map(|line| line.strip_prefix("nr_throttled "))?;
            line.trim().parse::<u64>().ok()
        };
        self.folders.iter().filter_map(times).any(|times| times > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_cores_are_counted() {
        for (list, count) in [("0\n", Some(1)), ("0-3,6\n", Some(5)), ("", None), ("3-1", None)] {
            assert_eq!(cores_in(list), count, "{list}");
        }
    }

    #[test]
    fn the_tightest_group_around_counts() {
        let root = tempfile::tempdir().unwrap();
        let own = root.path().join("a/b");
        fs::create_dir_all(&own).unwrap();
        let group = || Group::below(root.path(), "0::/a/b\n");
        assert_eq!((group().cores(), group().is_throttled()), (None, false));
        fs::write(own.join("cpu.max"), "max 100000\n").unwrap();
        fs::write(own.join("cpu.stat"), "usage_usec 7\nnr_throttled 0\n").unwrap();
        fs::write(root.path().join("a/cpu.max"), "150000 100000\n").unwrap();
        fs::write(root.path().join("a/cpu.stat"), "nr_periods 9\nnr_throttled 3\n").unwrap();
        assert_eq!((group().cores(), group().is_throttled()), (Some(1.5), true));
    }
}
