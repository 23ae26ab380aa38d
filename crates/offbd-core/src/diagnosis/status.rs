//! The ISO 14229-1 status byte (D.2) of one fault code, as a state machine.
//!
//! | bit | name |
//! | --- | --- |
//! | 0 | testFailed |
//! | 1 | testFailedThisOperationCycle |
//! | 2 | pendingDTC |
//! | 3 | confirmedDTC |
//! | 4 | testNotCompletedSinceLastClear |
//! | 5 | testFailedSinceLastClear |
//! | 6 | testNotCompletedThisOperationCycle |
//! | 7 | warningIndicatorRequested |

use core::fmt;
use serde::{Deserialize, Serialize};

/// The status byte. The initial value 0x50 means: nothing completed, nothing failed.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StatusByte(u8);

const TEST_FAILED: u8 = 0x01;
const FAILED_THIS_CYCLE: u8 = 0x02;
const PENDING: u8 = 0x04;
const CONFIRMED: u8 = 0x08;
const NOT_COMPLETED_SINCE_CLEAR: u8 = 0x10;
const FAILED_SINCE_CLEAR: u8 = 0x20;
const NOT_COMPLETED_THIS_CYCLE: u8 = 0x40;
const INDICATOR: u8 = 0x80;

impl StatusByte {
    /// Restores the byte from a store.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits)
    }

    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    #[must_use]
    pub const fn test_failed(self) -> bool {
        self.0 & TEST_FAILED != 0
    }

    #[must_use]
    pub const fn failed_this_cycle(self) -> bool {
        self.0 & FAILED_THIS_CYCLE != 0
    }

    #[must_use]
    pub const fn pending(self) -> bool {
        self.0 & PENDING != 0
    }

    #[must_use]
    pub const fn confirmed(self) -> bool {
        self.0 & CONFIRMED != 0
    }

    /// Whether the test has run to a result since the last clear.
    #[must_use]
    pub const fn completed_since_clear(self) -> bool {
        self.0 & NOT_COMPLETED_SINCE_CLEAR == 0
    }

    #[must_use]
    pub const fn failed_since_clear(self) -> bool {
        self.0 & FAILED_SINCE_CLEAR != 0
    }

    /// Whether the test has run to a result in this operation cycle.
    #[must_use]
    pub const fn completed_this_cycle(self) -> bool {
        self.0 & NOT_COMPLETED_THIS_CYCLE == 0
    }

    #[must_use]
    pub const fn indicator_requested(self) -> bool {
        self.0 & INDICATOR != 0
    }

    const fn set(&mut self, bits: u8) {
        self.0 |= bits;
    }

    const fn reset(&mut self, bits: u8) {
        self.0 &= !bits;
    }

    /// Takes FAILED: the debounce counter reached its upper end.
    pub const fn failed(&mut self) {
        self.set(TEST_FAILED | FAILED_THIS_CYCLE | PENDING | FAILED_SINCE_CLEAR);
        self.reset(NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE);
    }

    /// Confirms the fault: the trip counter reached the confirmation threshold.
    /// `indicator` requests the warning indicator as well.
    pub const fn confirm(&mut self, indicator: bool) {
        self.set(CONFIRMED);
        if indicator {
            self.set(INDICATOR);
        }
    }

    /// Takes PASSED: the debounce counter reached its lower end.
    pub const fn passed(&mut self) {
        self.reset(TEST_FAILED | NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE);
    }

    /// Starts an operation cycle; testFailed is kept.
    pub const fn start_cycle(&mut self) {
        self.reset(FAILED_THIS_CYCLE);
        self.set(NOT_COMPLETED_THIS_CYCLE);
    }

    /// Ends the operation cycle: clears pendingDTC if the test completed and never failed
    /// in it. Returns whether that was so (a good cycle).
    pub const fn end_cycle(&mut self) -> bool {
        let good = self.completed_this_cycle() && !self.failed_this_cycle();
        if good {
            self.reset(PENDING);
        }
        good
    }

    /// Switches the indicator off after enough good cycles.
    pub const fn heal(&mut self) {
        self.reset(INDICATOR);
    }

    /// Clears the confirmation after enough good cycles since healing.
    pub const fn age(&mut self) {
        self.reset(CONFIRMED);
    }
}

impl Default for StatusByte {
    fn default() -> Self {
        Self(NOT_COMPLETED_SINCE_CLEAR | NOT_COMPLETED_THIS_CYCLE)
    }
}

impl fmt::Display for StatusByte {
    /// Two upper-case hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:02X}", self.0)
    }
}

impl fmt::Debug for StatusByte {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:02X}", self.0)
    }
}
