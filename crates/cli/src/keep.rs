//! Studies that survive: finished cases in a folder, from which a study goes on.

use std::fmt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use mmsmith_ledger::{Claim, Ledger, LedgerError, Shard, ShardName};
use mmsmith_rare_states::{RareState, met};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::arguments::KeepOptions;
use crate::checksum::sha256;
use crate::json::prepare_folder;
use crate::library::{Origin, locate};
use crate::{machine, terminal};

/// How long to wait for cases that other processes are at work on, before they are looked at again.
const WAIT: Duration = Duration::from_millis(50);
/// A case whose threads waited for a core for a larger share of its time did not have its cores to itself.
const MOST_WAITING: f64 = 0.02;

/// Where the cases of a study are kept, if anywhere.
pub(crate) struct Keep(Option<Place>);

struct Place {
    store: Store,
    /// Origin of every result beside its settings.
    common: Value,
}

enum Store {
    /// A folder whose processes claim cases from one another.
    Ledger(Ledger),
    /// A folder whose processes have their cases from the start.
    Shard { shard: Shard, name: ShardName },
}

/// Whether cases run one after the other, each with all threads, or many at once, each with one.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    OneByOne,
    AtOnce,
}

/// The results of a study.
pub(crate) enum Found<T> {
    /// Results of all cases, in their order.
    All(Vec<T>),
    /// A shard has its own, and no table.
    Part(Part),
}

/// A shard's part of a study, finished.
pub(crate) struct Part {
    name: ShardName,
    /// Cases of this shard, cases whose results this shard knows, and all.
    own: usize,
    known: usize,
    all: usize,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, own, known, all } = self;
        write!(
            f,
            "shard {name}: its {own} of {all} cases are finished; {known} of all are in the folder\n\
             once all shards have ended, the same command without --shard prints the table\n"
        )
    }
}

impl Keep {
    /// Keeps the cases of a study of `solution` in the folder of `--out`, if one was given.
    ///
    /// Cases are known again by the build that computed them as well: another one may compute another result. `outputs` are the
    /// options that name files for the whole study, which a shard cannot write, and whether they were given.
    pub(crate) fn open(
        options: &KeepOptions,
        solution: &str,
        outputs: &[(&str, bool)],
    ) -> Result<Self> {
        let Some(folder) = &options.out else { return Ok(Self(None)) };
        if let (Some(name), Some((output, _))) =
            (options.shard, outputs.iter().find(|(_, given)| *given))
        {
            bail!(
                "--shard {name} {output}: a shard computes a part of the cases; give {output} to the same command without --shard, \
                 once all shards have ended"
            );
        }
        let common = origin(solution)?;
        let open = || match options.shard {
            None => Ledger::open(folder, &common).map(Store::Ledger),
            Some(name) => {
                Shard::open(folder, name, &common).map(|shard| Store::Shard { shard, name })
            }
        };
        let store = open().map_err(|error| refused(error, folder, solution)).context("--out")?;
        prepare_folder(folder).context("--out")?;
        let keep = Self(Some(Place { store, common }));
        keep.tell_damage();
        Ok(keep)
    }

    /// Keeps nothing.
    pub(crate) fn nowhere() -> Self {
        Self(None)
    }

    /// Which cases are this process's to compute, by their predicted costs, in any unit that is the same on all machines.
    pub(crate) fn own(&self, costs: &[f64]) -> Vec<bool> {
        match &self.0 {
            Some(Place { store: Store::Shard { name, .. }, .. }) => name.own(costs),
            _ => vec![true; costs.len()],
        }
    }

    /// The results of all cases, in their order: those that are kept, and what `compute` makes of the others. A shard computes
    /// its `own` alone.
    ///
    /// `settings` say all that a case's result depends on; threads are left out of them, for a result does not depend on
    /// their number. Cases that another process is at work on are waited for, last of all. `shared` is called on a result
    /// during whose making another case was under way, or, in a shard, another thread wanted its cores.
    pub(crate) fn all<T: Serialize + DeserializeOwned + Send>(
        &self,
        settings: &[Value],
        own: &[bool],
        order: Order,
        shared: impl Fn(&mut T) + Sync,
        compute: impl Fn(usize) -> Result<T> + Sync,
    ) -> Result<Found<T>> {
        let mut results: Vec<Option<T>> = settings.iter().map(|_| None).collect();
        let work = |index: usize| self.one(&settings[index], order, &shared, || compute(index));
        loop {
            let open: Vec<usize> = (0..settings.len())
                .filter(|&index| own[index] && results[index].is_none())
                .collect();
            if open.is_empty() {
                break;
            }
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
        Ok(match self.part(settings, own) {
            None => Found::All(results.into_iter().flatten().collect()),
            Some(part) => Found::Part(part),
        })
    }

    /// Part of a study that this process has, if it is a shard, when its `own` cases are finished.
    pub(crate) fn part(&self, settings: &[Value], own: &[bool]) -> Option<Part> {
        let Some(Place { store: Store::Shard { shard, name }, .. }) = &self.0 else { return None };
        let is_known =
            |settings: &&Value| self.key(settings).is_some_and(|key| shard.value(&key).is_some());
        let known = settings.iter().filter(is_known).count();
        let own = own.iter().filter(|own| **own).count();
        Some(Part { name: *name, own, known, all: settings.len() })
    }

    /// Key of a case.
    fn key(&self, settings: &Value) -> Option<Value> {
        let Place { common, .. } = self.0.as_ref()?;
        Some(json!({ "settings": decisive(settings), "from": common }))
    }

    /// The result of one case; `None` while another process is at work on it.
    fn one<T: Serialize + DeserializeOwned>(
        &self,
        settings: &Value,
        order: Order,
        shared: impl Fn(&mut T),
        compute: impl FnOnce() -> Result<T>,
    ) -> Result<Option<T>> {
        let (Some(Place { store, .. }), Some(key)) = (&self.0, self.key(settings)) else {
            return compute().map(Some);
        };
        let read = |value: Value| {
            let result = serde_json::from_value(value);
            result.map(Some).context("--out: a kept case is not of the form that is expected")
        };
        let form = |result: &T| serde_json::to_value(result).context("cannot form JSON");
        match store {
            Store::Ledger(ledger) => match ledger.claim(&key).context("--out")? {
                Claim::Taken => Ok(None),
                Claim::Done(value) => read(value),
                Claim::Mine(case) => {
                    let mut result = compute()?;
                    if !case.alone().context("--out")? {
                        shared(&mut result);
                    }
                    case.finish(&form(&result)?).context("--out")?;
                    Ok(Some(result))
                }
            },
            Store::Shard { shard, .. } => {
                if let Some(value) = shard.value(&key) {
                    met(RareState::ShardResumed);
                    return read(value);
                }
                let (started, before) = (Instant::now(), machine::waited_for_cores());
                let mut result = compute()?;
                let waited = before
                    .zip(machine::waited_for_cores())
                    .map(|(before, after)| after.saturating_sub(before));
                let is_alone = order == Order::OneByOne
                    && waited.is_some_and(|waited| {
                        waited.as_secs_f64() <= MOST_WAITING * started.elapsed().as_secs_f64()
                    });
                if !is_alone {
                    shared(&mut result);
                }
                shard.finish(&key, &form(&result)?).context("--out")?;
                Ok(Some(result))
            }
        }
    }

    fn tell_damage(&self) {
        let damaged = match &self.0 {
            None => return,
            Some(Place { store: Store::Ledger(ledger), .. }) => ledger.take_damaged(),
            Some(Place { store: Store::Shard { shard, .. }, .. }) => shard.take_damaged(),
        };
        for damage in damaged {
            let aside =
                damage.moved_to.map(|file| format!("it is set aside in {}", file.display()));
            terminal::warn(format_args!(
                "{}, line {}: {}; {}, and its case is computed again",
                damage.file.display(),
                damage.line,
                damage.problem,
                aside.as_deref().unwrap_or("it is passed over")
            ));
        }
    }
}

/// A folder's refusal in the words of the command line.
fn refused(error: LedgerError, folder: &Path, solution: &str) -> anyhow::Error {
    let LedgerError::OtherOrigin { path, found, expected } = error else { return error.into() };
    let by = if found["build"] == expected["build"] {
        format!("for another text of the specification than {solution} has now")
    } else {
        format!(
            "by another build of mms ({}) than this one ({BUILD})",
            found["build"].as_str().unwrap_or("unknown")
        )
    };
    anyhow::anyhow!(
        "{} was written {by}: name another folder, as in --out {}-2, for all shards",
        path.display(),
        folder.display()
    )
}

/// The settings that results depend on: all but the numbers of threads and processes.
pub(crate) fn decisive(settings: &Value) -> Value {
    let mut settings = settings.clone();
    if let Some(settings) = settings.as_object_mut() {
        settings.retain(|key, _| !["threads", "ranks"].contains(&key.as_str()));
    }
    settings
}

/// Identity of this build among all that may compute other bits: a checksum of its sources, compiler and target.
const BUILD: &str = env!("MMS_BUILD");

/// Origin of results beside their settings: the build, and a specification file's text.
pub(crate) fn origin(solution: &str) -> Result<Value> {
    // What was compiled in is part of the build.
    let specification = match locate(solution)? {
        Origin::BuiltIn(_) | Origin::Text { .. } => None,
        Origin::File { text, .. } => Some(sum(text.as_bytes())),
    };
    Ok(json!({ "build": BUILD, "specification": specification }))
}

/// Results of `work` for each of `cases`, in their order: on as many threads as there are here, each case on one.
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
    sha256(bytes)[..16].to_owned()
}
