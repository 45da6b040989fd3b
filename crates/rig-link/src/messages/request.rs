//! What the host asks of the board.

use crate::codes::{Setting, TableRefusal};
use crate::lvdt_curve::LvdtCurve;
use crate::versions::Versions;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What the host asks of the board.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request {
    /// The greeting, which both sides understand whatever their versions. It stays the first variant, see [`Versions`].
    Hello(Versions),
    /// The host is running. No reply.
    Heartbeat,
    /// Find the half-turn pre-twist and estimate the load.
    Home {
        /// Where the load's weight comes from.
        load: LoadChoice,
    },
    /// Bring the load to a position.
    Move {
        /// Wanted position (m).
        target_m: f32,
        /// Speed of the load on the way (m/s); infinite is as fast as the motor and the setting `speed-max` allow.
        speed_m_per_s: f32,
        /// Where the load's weight comes from.
        load: LoadChoice,
    },
    /// Follow a stream of set-points, of which this is the next one. The first one starts it. It ends in a hold: by `Stop`, when
    /// the next one does not come in time, and by one that is refused. A `Move` goes on from it.
    Track {
        /// Where the load should be when this arrives (m).
        position_m: f32,
        /// How fast it should move then (m/s); it goes on like that until the next one comes.
        speed_m_per_s: f32,
        /// For how long at most this goes on without the next one (s).
        for_s: f32,
    },
    /// Turn the strings at a constant speed, homed or not, within the twist limits.
    Jog {
        /// Twist speed, positive twists up (rad/s).
        twist_speed_rad_per_s: f32,
    },
    /// Ramp down and hold. Accepted in every state. It overtakes all requests that wait, which are refused.
    Stop,
    /// Clear the latched faults, if their causes have gone.
    Clear,
    /// Send the identity again.
    Status,
    /// A part of a table's record. When the record is complete the board checks it, uses the table and keeps it in flash; the
    /// rig must then be homed again.
    TablePart(TablePart),
    /// Send the settings.
    GetSettings,
    /// Change one setting at once, and keep it in flash; `Settings` follows when it is there. Refused during a motion.
    SetSetting {
        /// Which.
        setting: Setting,
        /// Its new value (its unit).
        value: f32,
    },
    /// Change all settings: all of them are accepted, or none.
    SetSettings(SettingValues),
    /// Send the present readings of the sensors, homed or not.
    ReadSensors,
    /// Turn the shaft slowly by less than a tenth of a radian of the strings each way, in open loop, and compare which way
    /// the drive and the rig's own encoder count. Every first motion after a start of the drive begins with it.
    CheckDirection,
}

impl Request {
    /// A homing that weighs the load itself.
    pub const HOME: Self = Self::Home { load: LoadChoice::Auto };
}

/// All that a board's settings are.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingValues {
    /// One value for each [`Setting`], in the order of [`Setting::ALL`].
    pub numbers: [f32; Setting::ALL.len()],
    /// Correction of the LVDT, before its offset and gain.
    pub lvdt_curve: Option<LvdtCurve>,
}

/// Words of one [`TablePart`].
pub const TABLE_PART_WORDS: usize = 32;

/// Consecutive words of a table's record (`tsa_table::record`), which has four bytes a word, little-endian. The parts are sent in
/// order; the first begins a new record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TablePart {
    /// Place of the first word in the record.
    pub offset: u16,
    /// Length of the record in words.
    pub total: u16,
    /// The words; beyond the end of the record they do not count.
    pub words: [u32; TABLE_PART_WORDS],
}

impl TablePart {
    /// The parts of a record.
    ///
    /// # Panics
    /// If the record is no whole number of words, or has more than 65535.
    pub fn of_record(record: &[u8]) -> impl Iterator<Item = Self> {
        let (words, rest) = record.as_chunks::<4>();
        let total = u16::try_from(words.len()).ok().filter(|_| rest.is_empty()).expect("a record");
        words.chunks(TABLE_PART_WORDS).zip((0..).step_by(TABLE_PART_WORDS)).map(move |(part, offset)| {
            let mut words = [0; TABLE_PART_WORDS];
            for (word, bytes) in words.iter_mut().zip(part) {
                *word = u32::from_le_bytes(*bytes);
            }
            Self { offset, total, words }
        })
    }
}

/// The record that parts make, on the board. `N` is the most bytes of a record.
#[derive(Debug, Clone)]
pub struct TableParts<const N: usize> {
    bytes: heapless::Vec<u8, N>,
}

impl<const N: usize> TableParts<N> {
    /// No part yet.
    pub const fn new() -> Self {
        Self { bytes: heapless::Vec::new() }
    }

    /// Takes the next part; the record when it is complete.
    ///
    /// # Errors
    /// [`TableRefusal::Incomplete`] if a part before it is missing, or the record is longer than `N`. Only a first part is
    /// taken then.
    pub fn add(&mut self, part: &TablePart) -> Result<Option<&[u8]>, TableRefusal> {
        if part.offset == 0 {
            self.bytes.clear();
        }
        let (offset, total) = (4 * usize::from(part.offset), 4 * usize::from(part.total));
        if offset != self.bytes.len() || offset >= total || total > N {
            self.bytes.clear();
            return Err(TableRefusal::Incomplete);
        }
        let bytes = part.words.iter().flat_map(|word| word.to_le_bytes());
        self.bytes.extend(bytes.take(total - offset));
        Ok((self.bytes.len() == total).then_some(&self.bytes))
    }
}

impl<const N: usize> Default for TableParts<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Where homing or a move takes the load from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LoadChoice {
    /// The board's own estimate.
    Auto,
    /// The operator's value (N).
    Known(f32),
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    fn record(words: u8) -> Vec<u8> {
        (0..words).flat_map(|k| [k, 1, 2, 3]).collect()
    }

    #[test]
    fn the_parts_of_a_record_make_it_again() {
        for words in [1, 31, 32, 33, 64, 100] {
            let record = record(words);
            let parts: Vec<TablePart> = TablePart::of_record(&record).collect();
            assert_eq!(parts.len(), usize::from(words).div_ceil(TABLE_PART_WORDS));
            let mut board = TableParts::<400>::new();
            let (last, before) = parts.split_last().unwrap();
            // A record that was broken off is begun again.
            for part in before.iter().chain(before) {
                assert_eq!(board.add(part), Ok(None));
            }
            assert_eq!(board.add(last), Ok(Some(&record[..])));
        }
    }

    #[test]
    fn a_part_without_the_one_before_it_or_of_too_long_a_record_is_refused() {
        let record = record(100);
        let parts: Vec<TablePart> = TablePart::of_record(&record).collect();
        let mut board = TableParts::<400>::new();
        assert_eq!(board.add(&parts[1]), Err(TableRefusal::Incomplete));
        assert_eq!(board.add(&parts[0]), Ok(None));
        assert_eq!(board.add(&parts[2]), Err(TableRefusal::Incomplete));
        assert_eq!(board.add(&parts[1]), Err(TableRefusal::Incomplete), "the first one is forgotten, too");
        assert_eq!(TableParts::<396>::new().add(&parts[0]), Err(TableRefusal::Incomplete));
        assert_eq!(board.add(&TablePart { total: 0, ..parts[0] }), Err(TableRefusal::Incomplete));
    }
}
