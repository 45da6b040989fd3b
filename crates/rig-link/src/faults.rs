//! Sets of faults: several can be latched at a time.

use crate::codes::Fault;
use core::fmt;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// A set of faults, one bit for each code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults(u64);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);

    /// The set of these.
    pub const fn of(faults: &[Fault]) -> Self {
        let mut set = Self::NONE;
        let mut i = 0;
        while i < faults.len() {
            set = set.with(faults[i]);
            i += 1;
        }
        set
    }

    /// This set with one more.
    #[must_use]
    pub const fn with(self, fault: Fault) -> Self {
        Self(self.0 | 1 << fault.code())
    }

    /// The union of two sets.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The faults that are not in `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Adds a fault.
    pub fn insert(&mut self, fault: Fault) {
        *self = self.with(fault);
    }

    /// Whether the set contains a fault.
    pub const fn contains(self, fault: Fault) -> bool {
        self.0 & 1 << fault.code() != 0
    }

    /// Whether two sets have a fault in common.
    pub const fn meets(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The faults in the order of [`Fault::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.iter().copied().filter(move |fault| self.contains(*fault))
    }
}

impl fmt::Display for Faults {
    /// The names, separated by blanks.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, fault) in self.iter().enumerate() {
            write!(f, "{}{fault}", if k > 0 { " " } else { "" })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::{String, ToString};

    #[test]
    fn every_fault_has_a_bit_of_its_own() {
        let mut all = Faults::NONE;
        for &fault in Fault::ALL {
            assert!(fault.code() < 64 && !all.contains(fault), "{fault}");
            all.insert(fault);
        }
        assert!(all.iter().eq(Fault::ALL.iter().copied()));
        let two = Faults::of(&[Fault::LvdtOpen, Fault::DriveStall]);
        assert_eq!(two.without(Faults::of(&[Fault::LvdtOpen])), Faults::NONE.with(Fault::DriveStall));
        assert_eq!(two.with(Fault::LvdtOpen), two, "twice is once");
        let other = Faults::of(&[Fault::DriveStall, Fault::Supply]);
        assert!(two.and(other).iter().eq([Fault::DriveStall, Fault::LvdtOpen, Fault::Supply]));
        assert!(!two.meets(Faults::of(&[Fault::Supply])) && Faults::NONE.is_empty());
        assert_eq!((two.to_string(), Faults::NONE.to_string()), ("drive-stall lvdt-open".into(), String::new()));
        assert!(two.meets(Faults::of(&[Fault::DriveStall, Fault::Supply])) && !two.is_empty());
    }
}
