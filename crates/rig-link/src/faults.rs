//! Sets of codes: several faults can be latched at a time, and several doubts hold.

use crate::codes::{Doubt, Fault};
use core::fmt;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

macro_rules! code_set {
    ($(#[$doc:meta])* $set:ident($bits:ty) of $code:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $set($bits);

        impl $set {
            /// The empty set.
            pub const NONE: Self = Self(0);

            /// The set of these.
            pub const fn of(codes: &[$code]) -> Self {
                let mut set = Self::NONE;
                let mut i = 0;
                while i < codes.len() {
                    set = set.with(codes[i]);
                    i += 1;
                }
                set
            }

            /// This set with one more.
            #[must_use]
            pub const fn with(self, code: $code) -> Self {
                Self(self.0 | 1 << code.code())
            }

            /// The union of two sets.
            #[must_use]
            pub const fn and(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }

            /// What is not in `other`.
            #[must_use]
            pub const fn without(self, other: Self) -> Self {
                Self(self.0 & !other.0)
            }

            /// Adds a code.
            pub fn insert(&mut self, code: $code) {
                *self = self.with(code);
            }

            /// Whether the set contains a code.
            pub const fn contains(self, code: $code) -> bool {
                self.0 & 1 << code.code() != 0
            }

            /// Whether two sets have a code in common.
            pub const fn meets(self, other: Self) -> bool {
                self.0 & other.0 != 0
            }

            /// Whether the set is empty.
            pub const fn is_empty(self) -> bool {
                self.0 == 0
            }

            /// The codes in their order.
            pub fn iter(self) -> impl Iterator<Item = $code> {
                $code::ALL.iter().copied().filter(move |code| self.contains(*code))
            }
        }

        impl fmt::Display for $set {
            /// The names, separated by blanks.
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                for (k, code) in self.iter().enumerate() {
                    write!(f, "{}{code}", if k > 0 { " " } else { "" })?;
                }
                Ok(())
            }
        }
    };
}

code_set! {
    /// A set of faults, one bit for each code.
    Faults(u64) of Fault
}

code_set! {
    /// A set of doubts, one bit for each code.
    Doubts(u8) of Doubt
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::{String, ToString};

    #[test]
    fn every_code_has_a_bit_of_its_own() {
        assert!(Doubt::ALL.iter().all(|doubt| doubt.code() < 8));
        let both = Doubts::of(&[Doubt::LoadUnknown, Doubt::LoadRange]);
        assert_eq!(both.to_string(), "load-range load-unknown");
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
