//! Exports that are composed in memory while later stages run, so that they only have to be written when the stages are done.
//!
//! Nothing of them is on the disk before that: a run that is interrupted writes no export, and the results of stages do not
//! compete with exports for the last room. Whatever goes wrong here is left to the writing, which composes them again
//! and says so in its turn.

use super::executor::{Executor, lock};
use super::export::{Hashing, compose, writes_of};
use crate::artifact::Value;
use crate::hash::ContentHash;
use crate::interrupt::Interrupt;
use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// Bytes of all these exports together. The STEP file of a part of 1,500 patches has 34 MB; what does not fit is composed when
/// it is written.
const ROOM: usize = 256 << 20;

/// Bytes that are kept together: one piece for all would be copied as it grows.
const PIECE: usize = 1 << 20;

/// An export that is ready to be written.
pub(super) struct Composed {
    /// What it was composed from.
    value: Value,
    /// One after the other.
    pub(super) pieces: Vec<Vec<u8>>,
    pub(super) bytes: u64,
    pub(super) content: ContentHash,
}

/// What has been composed, by the place of the export in the spec.
pub(super) struct Ahead {
    composed: Vec<Mutex<Option<Composed>>>,
    room: AtomicUsize,
}

impl Ahead {
    pub(super) fn new(exports: usize) -> Self {
        Self { composed: (0..exports).map(|_| Mutex::default()).collect(), room: AtomicUsize::new(ROOM) }
    }

    /// Export `at` of a stage with this result, if it was composed.
    pub(super) fn take(&self, at: usize, value: Option<&Value>) -> Option<Composed> {
        let composed = lock(&self.composed[at]).take()?;
        value.is_some_and(|value| Arc::ptr_eq(value, &composed.value)).then_some(composed)
    }
}

impl Executor<'_> {
    /// Composes an export of a result.
    pub(super) fn compose_ahead(&self, at: usize, value: Value) {
        let export = &self.pipeline().exports[at];
        let memory = InMemory { pieces: Vec::new(), room: &self.ahead.room, interrupt: self.interrupt };
        if let Ok(Hashing { to, hasher, bytes }) = compose(export, &value, memory) {
            let content = ContentHash::from_bytes(*hasher.finalize().as_bytes());
            let composed = Composed { value, pieces: to.pieces, bytes, content };
            *lock(&self.ahead.composed[at]) = Some(composed);
        }
    }

    /// The exports of a stage, by their places in the spec.
    pub(super) fn exports_ahead(&self, stage: usize) -> Vec<usize> {
        let exports = &self.pipeline().exports;
        let of_stage = (0..exports.len()).filter(|&at| exports[at].stage == stage);
        of_stage.filter(|&at| writes_of(self, &exports[at])).collect()
    }
}

/// Memory, as long as there is room and nobody wants the run to stop.
struct InMemory<'a> {
    pieces: Vec<Vec<u8>>,
    room: &'a AtomicUsize,
    interrupt: &'a Interrupt,
}

impl Write for InMemory<'_> {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        let fits = |room: usize| room.checked_sub(buffer.len());
        if self.interrupt.is_raised()
            || self.room.fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits).is_err()
        {
            return Err(std::io::Error::other("it is not composed ahead"));
        }
        match self.pieces.last_mut().filter(|piece| piece.capacity() - piece.len() >= buffer.len()) {
            Some(piece) => piece.extend_from_slice(buffer),
            None => {
                let mut piece = Vec::with_capacity(buffer.len().max(PIECE));
                piece.extend_from_slice(buffer);
                self.pieces.push(piece);
            }
        }
        Ok(buffer.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
