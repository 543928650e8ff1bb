//! Studies that survive: finished cases in a folder, from which a study goes on.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::{Context, Result};
use mmsmith_ledger::{Claim, Ledger};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use crate::json::prepare_folder;
use crate::library::{Origin, locate};
use crate::terminal;

/// How long to wait for cases that other processes are at work on, before they are looked at again.
const WAIT: Duration = Duration::from_millis(50);

/// Where the cases of a study are kept, if anywhere.
pub(crate) struct Keep(Option<Place>);

struct Place {
    ledger: Ledger,
    /// What every result depends on beside its settings.
    common: Value,
}

/// Whether cases run one after the other, each with all threads, or many at once, each with one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    OneByOne,
    AtOnce,
}

impl Keep {
    /// Keeps the cases of a study of `solution` in the folder of `--out`, if one was given.
    ///
    /// Cases are known again by the build that computed them as well: another one may compute another result.
    pub(crate) fn open(folder: Option<&PathBuf>, solution: &str) -> Result<Self> {
        let Some(folder) = folder else { return Ok(Self(None)) };
        let ledger = Ledger::open(folder).context("--out")?;
        prepare_folder(folder).context("--out")?;
        let keep = Self(Some(Place { ledger, common: origin(solution)? }));
        keep.tell_damage();
        Ok(keep)
    }

    /// The results of all cases, in their order: those that are kept, and what `compute` makes of the others.
    ///
    /// `settings` say all that a case's result depends on; threads are left out of them, for a result does not depend on
    /// their number. Cases that another process is at work on are waited for, last of all. `shared` is called on a result
    /// during whose making another case was under way.
    pub(crate) fn all<T: Serialize + DeserializeOwned + Send>(
        &self,
        settings: &[Value],
        order: Order,
        shared: impl Fn(&mut T) + Sync,
        compute: impl Fn(usize) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let mut results: Vec<Option<T>> = settings.iter().map(|_| None).collect();
        loop {
            let open: Vec<usize> =
                (0..settings.len()).filter(|index| results[*index].is_none()).collect();
            if open.is_empty() {
                break;
            }
            let work = |index: usize| self.one(&settings[index], &shared, || compute(index));
            let found = match order {
                Order::OneByOne => open.iter().map(|&index| work(index)).collect(),
                Order::AtOnce => at_once(&open, work),
            };
            let found: Vec<Option<T>> = found?;
            let idle = found.iter().all(Option::is_none);
            for (index, found) in open.into_iter().zip(found) {
                results[index] = found;
            }
            if idle {
                std::thread::sleep(WAIT);
            }
        }
        self.tell_damage();
        Ok(results.into_iter().flatten().collect())
    }

    /// The result of one case; `None` while another process is at work on it.
    fn one<T: Serialize + DeserializeOwned>(
        &self,
        settings: &Value,
        shared: impl Fn(&mut T),
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<Option<T>> {
        let Some(Place { ledger, common }) = &self.0 else { return compute().map(Some) };
        let key = json!({ "settings": decisive(settings), "from": common });
        match ledger.claim(&key).context("--out")? {
            Claim::Taken => Ok(None),
            Claim::Done(value) => {
                let result = serde_json::from_value(value);
                result.map(Some).context("--out: a kept case is not of the form that is expected")
            }
            Claim::Mine(case) => {
                let mut result = compute()?;
                if !case.alone().context("--out")? {
                    shared(&mut result);
                }
                let value = serde_json::to_value(&result).context("cannot form JSON")?;
                case.finish(&value).context("--out")?;
                Ok(Some(result))
            }
        }
    }

    fn tell_damage(&self) {
        let Some(Place { ledger, .. }) = &self.0 else { return };
        for damage in ledger.take_damaged() {
            terminal::warn(format_args!(
                "{}, line {}: {}; it is set aside in {}, and its case is computed again",
                damage.file.display(),
                damage.line,
                damage.problem,
                ledger.damaged_file().display()
            ));
        }
    }
}

/// The settings that results depend on: all but the number of threads.
pub(crate) fn decisive(settings: &Value) -> Value {
    let mut settings = settings.clone();
    settings.as_object_mut().and_then(|settings| settings.remove("threads"));
    settings
}

/// What tells this build from all that may compute other bits: a checksum of its sources, compiler and target.
const BUILD: &str = env!("MMS_BUILD");

/// What results depend on beside their settings: the build, and a specification file's text.
pub(crate) fn origin(solution: &str) -> Result<Value> {
    // What was compiled in is part of the build.
    let specification = match locate(solution)? {
        Origin::BuiltIn(_) => None,
        Origin::File { text, .. } => Some(sum(text.as_bytes())),
    };
    Ok(json!({ "build": BUILD, "specification": specification }))
}

/// What `work` makes of each of `cases`, in their order: on as many threads as there are here, each case on one.
fn at_once<R: Send>(cases: &[usize], work: impl Fn(usize) -> Result<R> + Sync) -> Result<Vec<R>> {
    let next = AtomicUsize::new(0);
    let failed = AtomicBool::new(false);
    let threads = rayon::current_num_threads().min(cases.len());
    let worker = || -> Result<Vec<(usize, Result<R>)>> {
        // A pool of its own: a thread that waits for its own case must not begin another.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.context("--threads: cannot start the threads")?;
        Ok(pool.install(|| {
            let mut found = Vec::new();
            loop {
                let place = next.fetch_add(1, Ordering::Relaxed);
                if place >= cases.len() || failed.load(Ordering::Relaxed) {
                    return found;
                }
                let outcome = work(cases[place]);
                failed.fetch_or(outcome.is_err(), Ordering::Relaxed);
                found.push((place, outcome));
            }
        }))
    };
    let found = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let join = |handle: std::thread::ScopedJoinHandle<'_, _>| match handle.join() {
            Ok(found) => found,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        handles.into_iter().map(join).collect::<Result<Vec<_>>>()
    })?;
    let mut found: Vec<_> = found.into_iter().flatten().collect();
    found.sort_by_key(|(place, _)| *place);
    found.into_iter().map(|(_, outcome)| outcome).collect()
}

/// A short checksum in hexadecimal digits.
fn sum(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}
