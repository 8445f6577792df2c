//! Threads that stay awake for the length of a step, so that a job of a few hundred tetrahedra is
//! worth sharing.
//!
//! A substep has some jobs of a few microseconds each. Waking a thread costs about as much, so
//! rayon's own loops lose here. The helpers of a [`Team`] spin on one word for the length
//! of a step and claim chunks of whatever the leader has published there. The leader claims chunks
//! too and waits for claimed ones only: with the other cores busy elsewhere it does all the work
//! itself and loses next to nothing. Who does a chunk does not change its result.

use std::cell::UnsafeCell;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

/// More helpers than this find too little to do.
const HELPERS_MAX: usize = 7;
/// A helper that has found nothing for so many looks lets other programs have the core.
const PATIENCE: u32 = 4096;

/// Bits of the claim word: first and one past the last chunk that nobody has claimed, and above both
/// the number of the job.
const CHUNK_BITS: u32 = 20;
const CHUNK_MASK: u64 = (1 << CHUNK_BITS) - 1;

type Job<'a> = &'a (dyn Fn(usize) + Sync);

/// A leader and its helpers.
pub struct Team {
    helpers: usize,
    /// Number of the job, one past its last free chunk, its first free chunk.
    claim: AtomicU64,
    /// Chunks of this job that are done.
    done: AtomicU32,
    /// The job that `claim` tells of. Written by the leader while no chunk is claimed.
    job: UnsafeCell<Option<Job<'static>>>,
    stop: AtomicBool,
}

// SAFETY: `job` is written by the leader only, before the `Release` store that publishes its chunks
// and after all chunks of the job before are done; helpers read it after the `Acquire` claim.
unsafe impl Sync for Team {}

impl Team {
    /// A leader alone.
    pub fn alone() -> Self {
        Self {
            helpers: 0,
            claim: AtomicU64::new(0),
            done: AtomicU32::new(0),
            job: UnsafeCell::new(None),
            stop: AtomicBool::new(false),
        }
    }

    /// Runs `lead` with the threads of rayon's current pool as helpers.
    pub fn with<R: Send>(lead: impl FnOnce(&Self) -> R + Send) -> R {
        let helpers = (rayon::current_num_threads() - 1).min(HELPERS_MAX);
        let team = Self {
            helpers,
            ..Self::alone()
        };
        if helpers == 0 {
            return lead(&team);
        }
        rayon::scope(|scope| {
            for _ in 0..helpers {
                scope.spawn(|_| team.help());
            }
            // Lets the helpers go even if the leader panics.
            let _stop = Stop(&team);
            lead(&team)
        })
    }

    /// Calls `job` once for each of `chunks`, in any order and on any thread, and returns when all
    /// calls have returned.
    ///
    /// # Panics
    ///
    /// If there are 2²⁰ chunks or more.
    pub fn run(&self, chunks: usize, job: impl Fn(usize) + Sync) {
        if self.helpers == 0 || chunks < 2 {
            (0..chunks).for_each(job);
            return;
        }
        assert!((chunks as u64) < CHUNK_MASK, "a job has fewer chunks");
        let job: Job = &job;
        // SAFETY: the job outlives its use: `Finish` waits for its last call, whichever way this
        // function is left. No chunk is claimed now, so nobody reads.
        unsafe { *self.job.get() = Some(std::mem::transmute::<Job, Job<'static>>(job)) };
        self.done.store(0, Ordering::Relaxed);
        let number = (self.claim.load(Ordering::Relaxed) >> (2 * CHUNK_BITS)) + 1;
        let published = (number << (2 * CHUNK_BITS)) | ((chunks as u64) << CHUNK_BITS);
        self.claim.store(published, Ordering::Release);
        // Also if a chunk of the leader panics: helpers must be done with the job before it goes.
        let _finish = Finish {
            team: self,
            chunks: chunks as u32,
        };
        while self.claim_and_do(End::First) {}
    }

    /// Calls `job` for runs of `values` of at most `length`, with the number of the first.
    pub fn for_runs<T: Send>(
        &self,
        values: &mut [T],
        length: usize,
        job: impl Fn(usize, &mut [T]) + Sync,
    ) {
        let count = values.len();
        let slice = SharedSlice::new(values);
        self.run(count.div_ceil(length), |chunk| {
            let start = chunk * length;
            // SAFETY: chunks are told apart by their number, each is run once.
            job(start, unsafe {
                slice.run(start, count.min(start + length))
            });
        });
    }

    /// What `job` makes of each chunk, in order.
    pub fn map<R: Clone + Default + Send>(
        &self,
        chunks: usize,
        job: impl Fn(usize) -> R + Sync,
    ) -> Vec<R> {
        let mut results = vec![R::default(); chunks];
        self.for_runs(&mut results, 1, |chunk, result| result[0] = job(chunk));
        results
    }

    /// Does one chunk if there is one.
    fn claim_and_do(&self, end: End) -> bool {
        let word = self.claim.load(Ordering::Acquire);
        let (first, past) = (word & CHUNK_MASK, (word >> CHUNK_BITS) & CHUNK_MASK);
        if first >= past {
            return false;
        }
        let (chunk, left) = match end {
            End::First => (first, word + 1),
            End::Last => (past - 1, word - (1 << CHUNK_BITS)),
        };
        let claimed =
            (self.claim).compare_exchange(word, left, Ordering::AcqRel, Ordering::Relaxed);
        if claimed.is_ok() {
            // Counts the chunk even if the job panics, so that the leader does not wait for ever.
            let _done = Done(&self.done);
            // SAFETY: a claimed chunk keeps the leader from writing.
            let job = unsafe { *self.job.get() }.expect("chunks are published with their job");
            job(chunk as usize);
        }
        true
    }

    fn help(&self) {
        let mut idle = 0;
        while !self.stop.load(Ordering::Relaxed) {
            if self.claim_and_do(End::Last) {
                idle = 0;
            } else if idle < PATIENCE {
                idle += 1;
                std::hint::spin_loop();
            } else {
                std::thread::yield_now();
            }
        }
    }
}

/// Which end of a job chunks are claimed from. The leader takes the first and helpers the last, so
/// that from one job to the next each works in the same part of the body, on particles that are
/// still in its core's cache.
#[derive(Clone, Copy)]
enum End {
    First,
    Last,
}

/// Takes back the chunks that nobody has claimed and waits for the others.
struct Finish<'a> {
    team: &'a Team,
    chunks: u32,
}

impl Drop for Finish<'_> {
    fn drop(&mut self) {
        let withdraw = |word: u64| {
            let past = (word >> CHUNK_BITS) & CHUNK_MASK;
            Some((word & !CHUNK_MASK) | past)
        };
        let claim = &self.team.claim;
        let before = claim.fetch_update(Ordering::AcqRel, Ordering::Acquire, withdraw);
        let word = before.unwrap_or_else(|word| word);
        let (first, past) = (word & CHUNK_MASK, (word >> CHUNK_BITS) & CHUNK_MASK);
        let claimed = self.chunks - past.saturating_sub(first) as u32;
        while self.team.done.load(Ordering::Acquire) < claimed {
            std::hint::spin_loop();
        }
    }
}

struct Stop<'a>(&'a Team);

impl Drop for Stop<'_> {
    fn drop(&mut self) {
        self.0.stop.store(true, Ordering::Relaxed);
    }
}

struct Done<'a>(&'a AtomicU32);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        self.0.fetch_add(1, Ordering::Release);
    }
}

/// A slice whose disjoint runs go to several threads.
pub struct SharedSlice<'a, T> {
    first: *mut T,
    length: usize,
    of: PhantomData<&'a mut [T]>,
}

// SAFETY: only runs that do not overlap are handed out at the same time (see `run`).
unsafe impl<T: Send> Sync for SharedSlice<'_, T> {}

impl<'a, T> SharedSlice<'a, T> {
    pub fn new(slice: &'a mut [T]) -> Self {
        Self {
            first: slice.as_mut_ptr(),
            length: slice.len(),
            of: PhantomData,
        }
    }

    /// Elements `start` to `end`.
    ///
    /// # Safety
    ///
    /// Runs that are used at the same time must not overlap.
    #[expect(clippy::mut_from_ref, reason = "the caller keeps runs apart")]
    pub unsafe fn run(&self, start: usize, end: usize) -> &mut [T] {
        assert!(start <= end && end <= self.length, "a run of the slice");
        // SAFETY: inside the slice, and the caller keeps runs apart.
        unsafe { std::slice::from_raw_parts_mut(self.first.add(start), end - start) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    fn pool(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("the system gives threads")
    }

    #[test]
    fn every_chunk_is_done_once_whatever_the_number_of_threads() {
        for threads in [1, 2, 5] {
            let calls: Vec<AtomicUsize> = (0..37).map(|_| AtomicUsize::new(0)).collect();
            pool(threads).install(|| {
                Team::with(|team| {
                    for _ in 0..200 {
                        team.run(calls.len(), |chunk| {
                            calls[chunk].fetch_add(1, Ordering::Relaxed);
                        });
                    }
                });
            });
            let counts: Vec<usize> = calls.iter().map(|c| c.load(Ordering::Relaxed)).collect();
            assert_eq!(counts, vec![200; 37], "{threads} threads");
        }
    }

    #[test]
    fn a_job_is_over_when_run_returns() {
        pool(3).install(|| {
            Team::with(|team| {
                let mut values = vec![0_u32; 1000];
                for round in 1..100 {
                    team.for_runs(&mut values, 7, |start, run| {
                        for (offset, value) in run.iter_mut().enumerate() {
                            *value = round + (start + offset) as u32;
                        }
                    });
                    assert!((0..1000).all(|i| values[i] == round + i as u32));
                }
            });
        });
    }

    #[test]
    fn a_panic_in_a_chunk_reaches_the_leader() {
        let outcome = std::panic::catch_unwind(|| {
            pool(2).install(|| {
                Team::with(|team| team.run(8, |chunk| assert!(chunk != 3, "chunk 3 fails")));
            });
        });
        assert!(outcome.is_err());
    }
}
