//! Detects the machine's vector instructions once, and compiles the same code for
//! each set of them.
//!
//! The standard library suffices: three functions with one body, and one `unsafe`
//! call of each function that not every machine can run. A crate (`multiversion`,
//! `pulp`) would replace these lines, at the price of a procedural macro or of a
//! vector type in every formula.

use std::fmt;

use super::PlateColumns;
use super::block::{LANES, LaneBlock, Row, Scratch};

/// A set of vector instructions that this machine has. All sets give bit-identical
/// results: multiplications and additions are never contracted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instructions(InstructionSet);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InstructionSet {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// The instructions that every machine of the compilation target has.
    pub const PORTABLE: Self = Self(InstructionSet::Portable);

    /// Returns all sets that this machine has, the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        let candidates = [
            Some(InstructionSet::Portable),
            #[cfg(target_arch = "x86_64")]
            is_x86_feature_detected!("avx2").then_some(InstructionSet::Avx2),
            #[cfg(target_arch = "x86_64")]
            is_x86_feature_detected!("avx512f").then_some(InstructionSet::Avx512),
        ];
        candidates.into_iter().flatten().map(Self)
    }

    /// Returns the widest set that this machine has.
    #[must_use]
    pub fn widest() -> Self {
        Self::available().last().unwrap_or(Self::PORTABLE)
    }

    /// Advances every block by one step on its plates.
    #[expect(unsafe_code, reason = "calls functions compiled for instructions that were found")]
    pub(super) fn step(self, blocks: &mut [LaneBlock], plates: &PlateColumns<'_>) {
        match self.0 {
            InstructionSet::Portable => step(blocks, plates),
            // SAFETY: the value exists, so `available` has found the feature.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => unsafe { step_avx2(blocks, plates) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => unsafe { step_avx512(blocks, plates) },
        }
    }
}

impl fmt::Display for Instructions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self.0 {
            InstructionSet::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 => "avx512",
        })
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn step_avx2(blocks: &mut [LaneBlock], plates: &PlateColumns<'_>) {
    step(blocks, plates);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn step_avx512(blocks: &mut [LaneBlock], plates: &PlateColumns<'_>) {
    step(blocks, plates);
}

#[inline(always)]
fn step(blocks: &mut [LaneBlock], plates: &PlateColumns<'_>) {
    let mut scratch: Scratch = [Row::ZERO; 4];
    let columns = plates.columns();
    let whole = columns.map(|column| column.as_chunks::<LANES>().0);
    let [c0, c1, c2, c3, c4, c5, c6] = whole;
    let inputs = c0.iter().zip(c1).zip(c2).zip(c3).zip(c4).zip(c5).zip(c6);
    let n_whole = c0.len();
    for (block, ((((((c0, c1), c2), c3), c4), c5), c6)) in blocks.iter_mut().zip(inputs) {
        block.step(&[c0, c1, c2, c3, c4, c5, c6], &mut scratch);
    }
    if let Some(block) = blocks.get_mut(n_whole) {
        let mut rest = [[0.0; LANES]; 7];
        for (padded, column) in rest.iter_mut().zip(columns) {
            let tail = column.as_chunks::<LANES>().1;
            padded[..tail.len()].copy_from_slice(tail);
        }
        block.step(&rest.each_ref(), &mut scratch);
    }
}
