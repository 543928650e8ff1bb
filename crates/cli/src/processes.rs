//! The processes that mpirun started together, where it did.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use mmsmith_verify::{CheckpointFolder, Ranks, RunTraffic, gather};

use crate::arguments::{Command, ProcessGrid};
use crate::terminal;

/// Variables in which launchers tell how many processes they started, and how many on this machine.
const COUNTS: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"];
const COUNTS_HERE: [&str; 3] =
    ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_TASKS_PER_NODE"];

/// Sooner than whatever started the processes kills those that do not end when asked to.
const SOON: Duration = Duration::from_millis(300);

/// The processes, as long as this one is one of several.
static RANKS: Mutex<Option<Arc<dyn Ranks>>> = Mutex::new(None);

fn number(names: &[&str]) -> Option<usize> {
    let value = names.iter().find_map(|name| std::env::var(name).ok())?;
    // Slurm writes 4(x2) for two machines of four each.
    let digits = value.chars().take_while(char::is_ascii_digit).collect::<String>();
    digits.parse().ok()
}

/// Whether the process was started alone, as far as launchers tell.
fn is_alone() -> bool {
    number(&COUNTS).is_none_or(|count| count <= 1)
}

/// Joins the other processes, if there are any: for the command's own program.
///
/// # Errors
///
/// Where the program cannot.
pub(crate) fn join() -> Result<()> {
    if is_alone() {
        return Ok(());
    }
    *RANKS.lock().unwrap_or_else(PoisonError::into_inner) = Some(start()?);
    Ok(())
}

#[cfg(feature = "mpi")]
fn start() -> Result<Arc<dyn Ranks>> {
    let Some(ranks) = mmsmith_message_passing::start() else {
        bail!("mpirun: this MPI does not allow calls from several threads, one at a time");
    };
    Ok(ranks)
}

#[cfg(not(feature = "mpi"))]
fn start() -> Result<Arc<dyn Ranks>> {
    bail!(
        "mpirun: this mms was built without MPI; build it with cargo build --release -p mmsmith-cli --features mpi, or start it once"
    )
}

/// The processes; none where this one is alone.
pub(crate) fn ranks() -> Option<Arc<dyn Ranks>> {
    RANKS.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// The processes, in the grid that is asked for.
///
/// # Errors
///
/// Where one process is asked to be several.
pub(crate) fn arranged(grid: Option<&ProcessGrid>) -> Result<Option<Arc<dyn Ranks>>> {
    let Some(ProcessGrid(along_axes)) = grid else { return Ok(ranks()) };
    let count: usize = along_axes.iter().product();
    match ranks() {
        Some(ranks) => Ok(Some(mmsmith_verify::arranged(ranks, along_axes.clone()))),
        None if count == 1 => Ok(None),
        None => bail!("--process-grid: one process runs; start {count} with mpirun -n {count}"),
    }
}

/// Whether this process tells what all have done.
pub(crate) fn is_first() -> bool {
    ranks().is_none_or(|ranks| ranks.rank() == 0)
}

/// Does `work` with the number of threads asked for.
pub(crate) fn with_threads<R: Send>(
    asked: Option<usize>,
    work: impl FnOnce() -> Result<R> + Send,
) -> Result<R> {
    // Zero lets rayon take all cores.
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads(asked))
        .build()
        .context("--threads: cannot start the threads")?
        .install(crate::progress::watched_as_here(work))
}

/// The default number of threads of a process: its part of the cores here. Zero takes all.
fn threads(said: Option<usize>) -> usize {
    let part = || {
        let here = number(&COUNTS_HERE).unwrap_or(1).max(1);
        (crate::machine::cores() / here).max(1)
    };
    said.unwrap_or_else(|| if ranks().is_some() { part() } else { 0 })
}

/// Refuses what several processes cannot do together.
pub(crate) fn admit(command: &Command) -> Result<()> {
    let Some(ranks) = ranks() else { return Ok(()) };
    let count = ranks.count();
    let study = |name: &str| {
        bail!(
            "mpirun -n {count} mms {name}: the cases of a study need nothing of each other; start its shards alone instead, each with \
             --out DIR --shard I/{count}"
        )
    };
    match command {
        Command::Run(_) | Command::Resume(_) => Ok(()),
        Command::Converge(_) => study("converge"),
        Command::Stability(_) => study("stability"),
        Command::Tradeoff(_) => study("tradeoff"),
        _ => bail!(
            "mpirun -n {count}: several processes do mms run and mms resume together; start one for this"
        ),
    }
}

/// Says how much the processes sent in a step, for users who want to know; a call of all.
pub(crate) fn tell_traffic(traffic: &RunTraffic) {
    let Some(ranks) = ranks() else { return };
    let RunTraffic { stepping, measuring, steps } = traffic;
    let own = [stepping.messages, stepping.bytes, measuring.messages, measuring.bytes];
    let all = gather(&*ranks, &own);
    let (each, _) = all.as_chunks::<4>();
    if each.is_empty() || *steps == 0 {
        return;
    }
    let a_step = |which: usize, most: bool| {
        let of_each = each.iter().map(|own| own[which]);
        let number = if most { of_each.max().unwrap_or(0) } else { of_each.sum() };
        number as f64 / *steps as f64
    };
    for (what, which) in [("stepping", 0), ("measuring and writing", 2)] {
        terminal::detail(format_args!(
            "  {what}: {:.1} messages of {:.0} bytes a step, all {} processes together; {:.0} bytes of the one that sends most",
            a_step(which, false),
            a_step(which + 1, false),
            each.len(),
            a_step(which + 1, true)
        ));
    }
}

/// Where the run that is under way keeps its state.
static KEPT: Mutex<Option<PathBuf>> = Mutex::new(None);

/// The run that begins keeps its state in this folder.
pub(crate) fn keep_in(folder: &Path) {
    *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = Some(folder.to_owned());
}

/// Says from where the run can go on, soon after all processes were asked to end, should this one still wait for another one then: what
/// started them asks them to where one of them was killed.
pub(crate) fn tell_last_checkpoint() {
    let Some(ranks) = ranks() else { return };
    let Some(folder) = KEPT.lock().unwrap_or_else(PoisonError::into_inner).clone() else { return };
    std::thread::spawn(move || {
        std::thread::sleep(SOON);
        // The first process holds the lock of the folder. If it is the one that is gone, one of the others gets it.
        let lock = if ranks.rank() == 0 { None } else { CheckpointFolder::lock(&folder).ok() };
        if ranks.rank() > 0 && lock.is_none() {
            return;
        }
        let (shown, reached) =
            (folder.display(), CheckpointFolder::reached(&folder).ok().flatten());
        let from = reached.map_or_else(
            || format!("no checkpoint is in {shown} yet: delete it and start the run anew"),
            |step| format!("its last whole checkpoint is of step {step}: mms resume {shown} goes on from there, on any number of processes"),
        );
        terminal::complain(&format!(
            "the run was asked to end, as it is where a process of it is killed; {from}\n"
        ));
        // Until the process ends, so that no other one says it as well.
        std::mem::forget(lock);
    });
}

/// Leaves the other processes, at the end.
pub(crate) fn leave() {
    drop(RANKS.lock().unwrap_or_else(PoisonError::into_inner).take());
}

/// Ends all processes, since this one has failed with `message`: others may wait for it. Does nothing where it is alone.
pub(crate) fn fail(message: &str, status: u8) {
    let Some(ranks) = ranks() else { return };
    if ranks.rank() > 0 {
        // What has failed at all of them the first one has told by now, and ended all.
        std::thread::sleep(Duration::from_secs(2));
        let _ = writeln!(std::io::stderr(), "error: process {}: {message}", ranks.rank());
    }
    #[cfg(feature = "mpi")]
    mmsmith_message_passing::abort(status);
    #[cfg(not(feature = "mpi"))]
    let _ = status;
}
