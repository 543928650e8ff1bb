//! Ranks of MPI.
//!
//! Messages are plain bytes whose length both sides know, so that no type can be mistaken for another.

#![allow(
    unsafe_code,
    reason = "sends that are under way after the call, by the functions of MPI itself"
)]

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mpi::Threading;
use mpi::collective::SystemOperation;
use mpi::environment::Universe;
use mpi::ffi;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{AsRaw, Communicator, CommunicatorCollectives, Equivalence};

use mmsmith_ranks::Ranks;

/// The most bytes of a message of MPI; longer messages are sent in several parts.
const MOST: usize = 1 << 30;
const TAG: i32 = 0;

struct Mpi {
    /// Calls of MPI hold this lock: MPI is started for one thread at a time.
    inner: Mutex<Inner>,
    rank: usize,
    count: usize,
}

struct Inner {
    world: SimpleCommunicator,
    /// Sends under way, with their bytes.
    sends: Vec<(ffi::MPI_Request, Box<[u8]>)>,
    // Ends MPI after all else is dropped.
    _universe: Universe,
}

// SAFETY: the communicator and the requests are handles of MPI, which was started for calls from any thread, one at a time
// (`Threading::Serialized`); the mutex around `Inner` sees to that.
unsafe impl Send for Inner {}

/// This process among the processes that were started together; `None` where MPI cannot be started for several threads, or was started
/// already.
#[must_use]
pub fn start() -> Option<Arc<dyn Ranks>> {
    let (universe, threading) = mpi::initialize_with_threading(Threading::Serialized)?;
    if threading < Threading::Serialized {
        return None;
    }
    let world = universe.world();
    let (rank, count) = (world.rank() as usize, world.size() as usize);
    let inner = Mutex::new(Inner { world, sends: Vec::new(), _universe: universe });
    Some(Arc::new(Mpi { inner, rank, count }))
}

/// Ends all processes that were started together, with this exit status.
pub fn abort(status: u8) -> ! {
    // SAFETY: MPI is started, or else this ends the process alone; the handle of all processes is a constant of MPI.
    unsafe { ffi::MPI_Abort(ffi::RSMPI_COMM_WORLD, status.into()) };
    std::process::exit(status.into())
}

impl Mpi {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    /// Forgets the sends that are complete; with `wait`, all sends once they are complete.
    fn settle(&mut self, wait: bool) {
        self.sends.retain_mut(|(request, _)| {
            let mut done = 0;
            // SAFETY: the request is one of `MPI_Isend` that has not been completed, and no status is asked for.
            unsafe {
                if wait {
                    ffi::MPI_Wait(request, ffi::RSMPI_STATUS_IGNORE);
                    done = 1;
                } else {
                    ffi::MPI_Test(request, &mut done, ffi::RSMPI_STATUS_IGNORE);
                }
            }
            done == 0
        });
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        // Sends under way read from memory that would be freed.
        self.settle(true);
    }
}

impl Ranks for Mpi {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.count
    }

    fn send(&self, to: usize, bytes: &[u8]) {
        let mut inner = self.inner();
        inner.settle(false);
        for piece in bytes.chunks(MOST) {
            let piece: Box<[u8]> = piece.into();
            let world = inner.world.as_raw();
            // SAFETY: a null handle of MPI is any value; `MPI_Isend` sets it.
            let mut request: ffi::MPI_Request = unsafe { std::mem::zeroed() };
            // SAFETY: the bytes are on the heap, where they stay until the request is completed: only `settle` forgets them, after
            // that. Their number fits into 32 bits.
            unsafe {
                ffi::MPI_Isend(
                    piece.as_ptr().cast(),
                    piece.len() as i32,
                    u8::equivalent_datatype().as_raw(),
                    to as i32,
                    TAG,
                    world,
                    &mut request,
                );
            }
            inner.sends.push((request, piece));
        }
    }

    fn receive(&self, from: usize, bytes: &mut [u8]) {
        let inner = self.inner();
        for piece in bytes.chunks_mut(MOST) {
            // SAFETY: the bytes are exclusive until the call returns, and as many as their number says. MPI ends all processes
            // where a message is longer.
            unsafe {
                ffi::MPI_Recv(
                    piece.as_mut_ptr().cast(),
                    piece.len() as i32,
                    u8::equivalent_datatype().as_raw(),
                    from as i32,
                    TAG,
                    inner.world.as_raw(),
                    ffi::RSMPI_STATUS_IGNORE,
                );
            }
        }
    }

    fn has_arrived(&self, from: usize) -> bool {
        let inner = self.inner();
        let mut has_arrived = 0;
        // SAFETY: the communicator is a live one, the flag is exclusive, and no status is asked for.
        unsafe {
            ffi::MPI_Iprobe(
                from as i32,
                TAG,
                inner.world.as_raw(),
                &mut has_arrived,
                ffi::RSMPI_STATUS_IGNORE,
            );
        }
        has_arrived != 0
    }

    fn largest(&self, value: u64) -> u64 {
        let mut largest = 0;
        self.inner().world.all_reduce_into(&value, &mut largest, SystemOperation::max());
        largest
    }
}
